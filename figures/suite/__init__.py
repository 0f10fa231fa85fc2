"""A benchmark of samplers and sequences, ``python -m figures suite``; the documentation has its protocol."""
