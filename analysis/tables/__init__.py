"""Programs that made the tables in ``qmcjax``: ``python -m analysis.tables.make_joe_kuo``, for example.

They are run once, and write into the ``_data`` of the package that reads the table.
"""

from pathlib import Path

import qmcjax

SEQUENCES = Path(qmcjax.__file__).parent / "sequences" / "_data"
"""Where tables of sequences are kept."""

ORDERS = Path(qmcjax.__file__).parent / "orders" / "_data"
"""Where tables of orders are kept."""

SAMPLERS = Path(qmcjax.__file__).parent / "samplers" / "_data"
"""Where tables of samplers are kept."""

CHOOSING = Path(qmcjax.__file__).parent / "choosing" / "_data"
"""Where what was measured of samplers is kept."""

TRACED = Path(qmcjax.__file__).parent / "scenes" / "traced" / "_data"
"""Where images of ray-traced scenes are kept."""
