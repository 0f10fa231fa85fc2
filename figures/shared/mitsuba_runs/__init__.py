"""Mitsuba 3 in processes of its own."""
