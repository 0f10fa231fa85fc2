"""Lattices and multiples of a vector modulo 1."""
