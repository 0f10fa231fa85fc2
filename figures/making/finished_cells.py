"""Cells of figures that take long: those that are finished stay, and the processes of a job share them."""

import hashlib
import time
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from figures.making import store


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

    def claim(self, cell: str) -> bool:
        """Take a cell that no process of the job has taken."""
        return self.claims is None or take(self.claims / cell)

    def read(self, cell: str) -> Any:
        """Return a finished cell, or None."""
        import numpy as np

        try:
            return np.load(self.kept / f"{cell}.npy")
        except (FileNotFoundError, ValueError, EOFError):  # none, or not a whole one
            return None

    def keep(self, cell: str, array: Any) -> None:
        import numpy as np

        buffer = BytesIO()
        np.save(buffer, array, allow_pickle=False)
        self.kept.mkdir(parents=True, exist_ok=True)
        store.write(self.kept / f"{cell}.npy", buffer.getvalue())

    def wait_for(self, cell: str, name: str) -> Any:
        """Return what another process of the job computes; if that is lost, the job ends."""
        while True:
            over = self.ended()
            array = self.read(cell)
            if array is not None:
                return array
            if over:
                raise RuntimeError(f"another process could not compute {name}: it says why")
            time.sleep(0.1)


PLACE: ContextVar[Place | None] = ContextVar("place", default=None)
"""That of the figure that this process makes; without one, cells are but computed."""


def take(path: Path) -> bool:
    """Take what stands for ``path``, and return whether no process has taken it before."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        path.with_name(f"{path.name}.taken").touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


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
    import numpy as np

    arrays: dict[str, Any] = {}

    def add(name: str, array: Any) -> None:
        arrays[name] = array
        progress(len(arrays) / len(cells))

    files = {name: hashlib.sha256(f"{label}: {name}".encode()).hexdigest()[:32] for name in cells}
    place = PLACE.get()
    for name, compute in reversed(list(cells.items())):
        array = place.read(files[name]) if place else None
        if array is None and (place is None or place.claim(files[name])):
            array = np.asarray(compute())
            if place:
                place.keep(files[name], array)
        if array is not None:
            add(name, array)
    for name in cells:
        if place and name not in arrays:
            add(name, place.wait_for(files[name], f"{label}, {name}"))
    return {name: arrays[name] for name in cells}
