"""Comparisons of samplers: errors, times and promises."""
