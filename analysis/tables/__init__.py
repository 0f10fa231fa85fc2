"""Programs that made the data of the library; ``python -m analysis.tables`` lists them. Not in the wheel."""

from pathlib import Path
from typing import Any

import numpy as np

import qmcjax

ROOMS = ("sequences", "orders", "samplers", "choosing", "scenes/traced")
SEQUENCES, ORDERS, SAMPLERS, CHOOSING, TRACED = (
    Path(qmcjax.__file__).parent / room / "_data" for room in ROOMS
)
"""Folders of the data."""

Content = str | bytes | dict[str, Any]
"""Of a text file, of any file, or of an archive of arrays."""


def write(path: Path, content: Content) -> None:
    """Replace a file, keeping the old one until the new one is complete."""
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    if isinstance(content, dict):
        np.savez_compressed(part, **content)
    else:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
    part.replace(path)
