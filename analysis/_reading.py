"""Points of other programs: files, and engines of scipy."""

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from qmcjax.core import checks
from qmcjax.sequences import Sequence

__all__ = ["SequenceEngine", "read_points"]


def read_points(path: str | PathLike[str], which: int = 0) -> NDArray[np.float64]:
    r"""Read a point set from a file.

    Parameters
    ----------
    path : path
        ``.npy``: an array of NumPy's. Anything else: text with one point a line, its coordinates separated by
        white space or commas, as UTK writes into ``.dat`` files. Lines that begin with ``#`` separate point
        sets.
    which : int
        The number of the point set in a text file, from 0 on.

    Returns
    -------
    float64 array, shape (n, dims)
        As they are: neither range nor number is checked. Text has the decimals that were printed; that
        moves a discrepancy by as much.

    Raises
    ------
    ValueError
        If a line has another number of coordinates than the first, is no line of numbers, there is no such
        point set, or the array is none of floats with shape (n, dims): names file and line.

    References
    ----------
    .. [1] H. Perrier, D. Coeurjolly, V. Ostromoukhov, "Uni(corn|form) tool kit", https://utk-team.github.io/utk.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w", suffix=".dat") as file:
    ...     _ = file.write("0.5 0.25\n#\n0.125 0.75\n0 0.5\n")
    ...     file.flush()
    ...     print(read_points(file.name, which=1))
    [[0.125 0.75 ]
     [0.    0.5  ]]
    """
    if not isinstance(path, str | PathLike):
        raise TypeError(f"path must be a path or a string, got {checks.shown(path)}")
    path = Path(path)
    which = checks.integer("which", which, 0, checks.INDEX_LIMIT - 1)
    if path.suffix == ".npy":
        array = np.load(path, allow_pickle=False)
        if array.ndim != 2 or not np.issubdtype(array.dtype, np.floating):
            raise ValueError(f"{path} must hold floats of shape (n, dims), got {array.dtype} {array.shape}")
        return array.astype(np.float64)
    sets = _point_sets(path)
    if which >= len(sets):
        raise ValueError(f"which must be below the {len(sets)} point sets of {path}, got {which}")
    return np.array(sets[which])


def _point_sets(path: Path) -> list[list[list[float]]]:
    sets: list[list[list[float]]] = [[]]
    with path.open() as lines:
        for number, line in enumerate(lines, start=1):
            if line.startswith("#"):
                sets.append([])
                continue
            try:
                point = [float(word) for word in line.replace(",", " ").split()]
            except ValueError:
                raise ValueError(f"{path}, line {number}, must be numbers, got {line.strip()!r}") from None
            if point:
                first = sets[-1][0] if sets[-1] else point
                if len(point) != len(first):
                    raise ValueError(
                        f"{path}, line {number}, must have {len(first)} coordinates, got {line.strip()!r}"
                    )
                sets[-1].append(point)
    return [points for points in sets if points]


class SequenceEngine(qmc.QMCEngine):
    """A sequence as an engine of ``scipy.stats.qmc``: for code that draws points one block after the other.

    Parameters
    ----------
    sequence : Sequence
        Owen-scrambled or not: what scipy calls ``scramble`` is the sequence's own matter.

    Raises
    ------
    ValueError
        If ``sequence`` is none; and from ``random`` or ``fast_forward`` if it has no more points.

    Notes
    -----
    The opposite way, :func:`qmcjax.sequences.tabulated` makes a sequence of an engine's points:
    ``tabulated(engine.random(n))``.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> engine = SequenceEngine(sequences.sobol(2))
    >>> print(engine.fast_forward(1).random(2))
    [[0.5  0.5 ]
     [0.25 0.75]]
    """

    def __init__(self, sequence: Sequence) -> None:
        if not isinstance(sequence, Sequence):
            raise ValueError(f"sequence must be a Sequence, got {sequence!r}")
        super().__init__(d=sequence.dims)
        self.sequence = sequence

    def _random(self, n: Any = 1, *, workers: Any = 1) -> NDArray[np.float64]:
        if n == 0:
            return np.empty((0, self.d))
        return np.asarray(self.sequence.points(n, self.num_generated, np.float64))

    def fast_forward(self, n: Any) -> "SequenceEngine":
        """Skip points.

        Parameters
        ----------
        n : int
            How many.

        Returns
        -------
        SequenceEngine
            This one.
        """
        left = self.sequence.limit - self.num_generated
        self.num_generated += checks.integer("n", n, 0, left)
        return self
