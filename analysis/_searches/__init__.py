"""Searches for points, nets, matrices and scramblings."""
