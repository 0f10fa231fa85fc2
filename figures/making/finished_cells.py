"""Cells of figures that take long: those that are finished stay, and the processes of a job share them."""

import hashlib
import time
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple


class Place(NamedTuple):
    """Where a figure's cells are while it is being made."""

    kept: Path
    claims: Path | None = None
    """A folder, new for each job, that all its processes see."""

    def begun(self) -> bool:
        """Tell whether processes of a job share cells here."""
        return self.claims is not None and self.claims.is_dir()

    def ended(self) -> bool:
        """Tell whether, in a job, nobody goes on with the figure."""
        return self.claims is not None and (self.claims / "ended").exists()

    def end(self) -> None:
        """Tell other processes of a job not to go on with the figure, nor to wait for cells of it."""
        if self.claims is not None:
            self.claims.mkdir(exist_ok=True)
            (self.claims / "ended").touch()


PLACE: ContextVar[Place | None] = ContextVar("place", default=None)
"""That of the figure that this process makes; without one, cells are but computed."""


def shared(
    label: str,
    cells: Mapping[str, Callable[[], Any]],
    progress: Callable[[float], None] = lambda fraction: None,
) -> dict[str, Any]:
    """Return the arrays that cells are computed to, by their names and in their order.

    ``label``: unlike that of any other call for the same figure. ``cells``: each computes an array, and is
    what the figure's code and quality make it. They are taken from the last to the first: with more samples
    they take longer, and are better not begun at the end. ``progress``: called with the finished part in
    (0, 1]. Raises RuntimeError if another process of the job could not compute a cell that it had taken.
    """
    found: dict[str, Any] = {}

    def add(name: str, array: Any) -> None:
        found[name] = array
        progress(len(found) / len(cells))

    files = {name: hashlib.sha256(f"{label}: {name}".encode()).hexdigest()[:32] for name in cells}
    place = PLACE.get()
    for name, compute in reversed(list(cells.items())):
        kept = None if place is None else _read(place, files[name])
        if kept is not None:
            add(name, kept)
        elif place is None or _claimed(place, files[name]):
            add(name, _keep(place, files[name], compute()))
    for name in cells:
        if name not in found and place is not None:
            add(name, _awaited(place, files[name], f"{label}, {name}"))
    return {name: found[name] for name in cells}


def _path(place: Place, file: str) -> Path:
    return place.kept / f"{file}.npy"


def _read(place: Place, file: str) -> Any:
    """Return a finished cell, or None."""
    import numpy as np

    try:
        return np.load(_path(place, file))
    except (FileNotFoundError, ValueError, EOFError):  # none, or not a whole one
        return None


def _keep(place: Place | None, file: str, array: Any) -> Any:
    import numpy as np

    from figures.making import store

    array, buffer = np.asarray(array), BytesIO()
    if place is not None:
        np.save(buffer, array, allow_pickle=False)
        place.kept.mkdir(parents=True, exist_ok=True)
        store.write(_path(place, file), buffer.getvalue())
    return array


def _claimed(place: Place, file: str) -> bool:
    """Take a cell that no process of the job has taken."""
    if place.claims is None:
        return True
    place.claims.mkdir(parents=True, exist_ok=True)
    try:
        (place.claims / f"{file}.taken").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


def _awaited(place: Place, file: str, name: str) -> Any:
    """Return what another process of the job computes. If that is lost, the job ends, and this process."""
    while True:
        over = place.ended()
        kept = _read(place, file)
        if kept is not None:
            return kept
        if over:
            raise RuntimeError(f"another process could not compute {name}: it says why")
        time.sleep(0.1)
