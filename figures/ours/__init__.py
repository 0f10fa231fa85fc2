"""Figures of our own: speed, stability, and what the papers leave open."""
