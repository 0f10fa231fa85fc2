"""Figures of Rendering along the Hilbert Curve."""
