"""Worlds of objects with materials and lights, and cameras."""
