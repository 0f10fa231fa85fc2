"""Figures of our own: speed, designs, and what the papers leave open."""
