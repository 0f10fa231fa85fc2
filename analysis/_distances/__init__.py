"""Distances between points on the torus and off it: minimum, nearest, energies, dispersion."""
