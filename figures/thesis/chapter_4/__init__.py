"""Figures and tables of chapter 4 of the thesis."""
