"""Cells of long computations: finished ones are kept, and the processes of a job share the work."""

import hashlib
import time
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from figures.making import store


class Place(NamedTuple):
    """The folder of a figure's cells while it is being made."""

    kept: Path
    claims: Path | None = None
    """A folder, new for each job, that all of its processes can see."""

    def begun(self) -> bool:
        """Return whether processes of a job share cells here."""
        return self.claims is not None and self.claims.is_dir()

    def ended(self) -> bool:
        """Return whether the job has finished or given up this figure."""
        return self.claims is not None and (self.claims / "ended").exists()

    def end(self) -> None:
        """Tell the other processes of a job to stop working on the figure and waiting for its cells."""
        if self.claims is not None:
            self.claims.mkdir(exist_ok=True)
            (self.claims / "ended").touch()

    def claim(self, cell: str) -> bool:
        """Claim a cell, and return whether no other process of the job has claimed it."""
        return self.claims is None or take(self.claims / cell)

    def read(self, cell: str) -> Any:
        """Return a finished cell, or None."""
        import numpy as np

        try:
            return np.load(self.kept / f"{cell}.npy")
        except (FileNotFoundError, ValueError, EOFError):  # missing or incomplete
            return None

    def keep(self, cell: str, array: Any) -> None:
        import numpy as np

        buffer = BytesIO()
        np.save(buffer, array, allow_pickle=False)
        self.kept.mkdir(parents=True, exist_ok=True)
        store.write(self.kept / f"{cell}.npy", buffer.getvalue())

    def wait_for(self, cell: str, name: str) -> Any:
        """Wait for a cell that another process of the job computes; if that process is lost, the job ends."""
        while True:
            over = self.ended()
            array = self.read(cell)
            if array is not None:
                return array
            if over:
                raise RuntimeError(f"another process could not compute {name}: it says why")
            time.sleep(0.1)


PLACE: ContextVar[Place | None] = ContextVar("place", default=None)
"""The place of the figure that this process makes; without one, cells are computed and not kept."""


def take(path: Path) -> bool:
    """Claim ``path``, and return whether no process has claimed it before."""
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
    """Return the arrays of all cells by name, in the given order.

    ``label``: unique among the calls for the same figure. ``cells``: functions that compute an array each,
    and depend on the code and quality of the figure only. They are called from the last to the first, since
    cells with more samples take longer and should start early. ``progress``: called with the finished
    fraction in (0, 1]. Raises RuntimeError if another process of the job could not compute a cell that it had
    claimed.
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
