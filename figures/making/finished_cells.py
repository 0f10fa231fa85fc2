"""Cells of long computations: each finished one is a file, so that an interrupted figure resumes."""

import hashlib
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import Any

from figures.making import store

PLACE: ContextVar[Path | None] = ContextVar("place", default=None)
"""The folder of the figure that this process makes; without one, cells are computed and not kept."""


def shared(
    label: str,
    cells: Mapping[str, Callable[[], Any]],
    progress: Callable[[float], None] = lambda fraction: None,
) -> dict[str, Any]:
    """Return the arrays of all cells by name, in the given order.

    ``label``: unique among the calls for the same figure. ``cells``: functions that compute an array each,
    and depend on the code and quality of the figure only. They are called from the last to the first: the
    longest come last. ``progress``: called with the finished fraction in (0, 1].
    """
    import numpy as np

    folder, arrays = PLACE.get(), {}
    for name, compute in reversed(list(cells.items())):
        file = folder and folder / f"{hashlib.sha256(f'{label}: {name}'.encode()).hexdigest()[:32]}.npy"
        arrays[name] = _kept(file, compute) if file else np.asarray(compute())
        progress(len(arrays) / len(cells))
    return {name: arrays[name] for name in cells}


def _kept(file: Path, compute: Callable[[], Any]) -> Any:
    """Return the array of a cell's file, written anew if it is missing or incomplete."""
    import numpy as np

    try:
        return np.load(file)
    except (FileNotFoundError, ValueError, EOFError):
        array, buffer = np.asarray(compute()), BytesIO()
    np.save(buffer, array, allow_pickle=False)
    file.parent.mkdir(parents=True, exist_ok=True)
    store.write(file, buffer.getvalue())
    return array
