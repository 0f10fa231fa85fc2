"""Errors of single precision."""
