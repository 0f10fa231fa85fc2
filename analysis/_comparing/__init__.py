"""Samplers side by side: errors, times and kept promises."""
