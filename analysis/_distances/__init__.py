"""Distances between points on the torus or in the cube: minimum, nearest, energies, dispersion."""
