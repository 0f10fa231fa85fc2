"""A benchmark of samplers and sequences, ``qmcjax suite``; the documentation has its protocol."""
