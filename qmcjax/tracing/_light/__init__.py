"""Reflection, emission and direct illumination at a point."""
