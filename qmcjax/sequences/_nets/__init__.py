"""Nets, lattices and Kronecker sequences."""
