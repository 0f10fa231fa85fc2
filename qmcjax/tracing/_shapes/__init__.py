"""Shapes, and objects of shapes that move together."""
