"""Mitsuba 3 in separate processes."""
