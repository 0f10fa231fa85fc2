"""Figures and tables of the motion blur thesis."""
