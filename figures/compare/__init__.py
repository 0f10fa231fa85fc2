"""Samplers and sequences compared, ``qmcjax compare``; the documentation has its protocol."""
