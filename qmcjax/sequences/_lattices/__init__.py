"""Lattices and Kronecker sequences."""
