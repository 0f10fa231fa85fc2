"""Programs that made the data of the library; ``python -m analysis.tables`` lists them. Not in the wheel."""

from pathlib import Path

import qmcjax

ROOMS = ("sequences", "orders", "samplers", "choosing", "scenes/traced")
SEQUENCES, ORDERS, SAMPLERS, CHOOSING, TRACED = (
    Path(qmcjax.__file__).parent / room / "_data" for room in ROOMS
)
"""Folders of the data."""
