"""Randomisations: a sequence in, a sequence out."""
