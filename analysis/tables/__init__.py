"""Programs that made the tables in ``qmcjax``, for example ``python -m analysis.tables.make_joe_kuo``.

They are run once, and write to the ``_data`` of the package that reads the table.
"""

from pathlib import Path

import qmcjax

SEQUENCES = Path(qmcjax.__file__).parent / "sequences" / "_data"
"""Folder of the tables of sequences."""

ORDERS = Path(qmcjax.__file__).parent / "orders" / "_data"
"""Folder of the tables of orders."""

SAMPLERS = Path(qmcjax.__file__).parent / "samplers" / "_data"
"""Folder of the tables of samplers."""

CHOOSING = Path(qmcjax.__file__).parent / "choosing" / "_data"
"""Folder of the measurements of samplers."""

TRACED = Path(qmcjax.__file__).parent / "scenes" / "traced" / "_data"
"""Folder of the images of ray-traced scenes."""
