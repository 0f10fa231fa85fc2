"""Randomisations: functions from a sequence to a sequence."""
