"""Figures of the Z-sampler paper."""
