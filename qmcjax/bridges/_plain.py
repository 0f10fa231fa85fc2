"""Samplers as plain objects: one number at a time, or NumPy arrays."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.pytrees import jit
from qmcjax.samplers import SamplerLike, as_sampler

_TILE = 16
"""Maximum number of columns and rows of a table."""

_LARGEST = 2**16
"""Approximate number of coordinates of a table: it has fewer pixels if there are many dimensions."""

PIECE = 2**20
"""Approximate number of coordinates computed together: 8 MiB in float64."""


class PlainSampler:
    """A sampler for programs without JAX: one number at a time, or whole arrays.

    Parameters
    ----------
    sampler : Sampler, any object that implements the protocol
    dtype : float32 or float64
        dtype of the coordinates.

    Notes
    -----
    Numbers are looked up in tables of 16 x 16 pixels and 8 samples, computed on demand; the latest 64 MiB are
    cached. So any order of pixels and samples gives the same numbers, and access to nearby samples is fast.
    :meth:`start` changes the object: use one object per thread.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> plain = PlainSampler(samplers.independent(sequences.sobol(3), key=1))
    >>> plain.start((5, 2), sample=7)
    >>> u, v = plain.get2d()
    >>> print(f"{u:.4f} {v:.4f} {plain.get1d():.4f}")
    0.7102 0.9689 0.0561
    """

    def __init__(self, sampler: SamplerLike, dtype: DTypeLike = np.float32) -> None:
        self.sampler = as_sampler("sampler", sampler)
        self.dtype = checks.floating(dtype)
        self._limits = self.sampler.fits.limits
        self._tables = Tables(self.sampler, self.dims, self._limits, 8, 2**24, self.dtype)
        self._point: list[float] = []
        self._next = 0

    @property
    def dims(self) -> int:
        """Number of coordinates per sample."""
        return self.sampler.dims

    def start(self, pixel: tuple[int, int], sample: int) -> None:
        """Begin with the first coordinate of a sample.

        Parameters
        ----------
        pixel : tuple of int, column and row
        sample : int
            Its index.
        """
        try:
            x, y = pixel
        except (TypeError, ValueError):
            raise TypeError(f"pixel must be column and row, got {checks.shown(pixel)}") from None
        columns, rows, samples = self._limits
        known = type(x) is type(y) is type(sample) is int  # the most usual case, at once
        if not (known and 0 <= x < columns and 0 <= y < rows and 0 <= sample < samples):
            x = checks.integer("pixel", x, 0, columns - 1)
            y = checks.integer("pixel", y, 0, rows - 1)
            sample = checks.integer("sample", sample, 0, samples - 1)
        self._point, self._next = self._tables(x, y, sample), 0

    def get1d(self) -> float:
        """Return the next coordinate of the sample.

        Returns
        -------
        float, in [0, 1)

        Raises
        ------
        ValueError
            Before :meth:`start`, or if the sampler has no more coordinates.
        """
        return self._take(1)[0]

    def get2d(self) -> tuple[float, float]:
        """Return the next two coordinates of the sample; the first two are the position inside the pixel.

        Returns
        -------
        tuple of float, in [0, 1)

        Raises
        ------
        ValueError
            Before :meth:`start`, or if the sampler has fewer than two more coordinates.
        """
        u, v = self._take(2)
        return u, v

    def array(self, width: int, height: int, spp: int, dims: tuple[int, ...] | None = None) -> NDArray:
        """Return the points of an image.

        Parameters
        ----------
        width, height : int, of the image
        spp : int, samples per pixel, from 0 on
        dims : tuple of int, optional
            The coordinates, all by default.

        Returns
        -------
        array of the sampler's ``dtype``, shape (height, width, spp, len(dims)), in [0, 1)
            Other libraries can import it by DLPack without a copy, for example by ``torch.from_dlpack``.
        """
        width, height = checks.image_size(width, height)
        spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT)
        wanted = checks.dimensions(dims, self.dims)
        self.sampler.check(width, height, spp)
        return pixel_points(self.sampler.up_to(spp), (0, 0), (width, height), 0, spp, wanted, self.dtype)

    def _take(self, count: int) -> list[float]:
        end = self._next + count
        if end > len(self._point):
            if not self._point:
                raise ValueError("call start(pixel, sample) before get1d() or get2d()")
            got = f"{self._next} of dims={self.dims} taken"
            raise ValueError(f"sampler must have {count} more coordinates, got {got}")
        taken = self._point[self._next : end]
        self._next = end
        return taken


class Tables:
    """Points of a sampler, one by one: from tables of nearby pixels and samples, made on demand.

    ``limits``: of columns, rows and samples. ``samples``: of a pixel in a table, at most. ``kept``: number of
    cached coordinates. Tables are counted from ``origin``: column, row and sample.
    """

    def __init__(
        self,
        sampler: Callable[..., Array],
        dims: int,
        limits: tuple[int, int, int],
        samples: int,
        kept: int,
        dtype: DTypeLike = np.float32,
        origin: tuple[int, int, int] = (0, 0, 0),
    ) -> None:
        count = min(samples, limits[2], max(1, _LARGEST // dims))
        tile = _TILE
        while tile > 1 and tile * tile * count * dims > _LARGEST:
            tile //= 2
        sides = self._sides = min(tile, limits[0]), min(tile, limits[1]), count
        self._origin = origin

        def made(*place: int) -> tuple[NDArray, int, int, int]:
            """Return a table and its start: the last ones start early enough to be as large as the others."""
            x, y, first = (
                max(0, min(start + k * side, limit - side))
                for start, k, side, limit in zip(origin, place, sides, limits, strict=True)
            )
            every = tuple(range(dims))
            return pixel_points(sampler, (x, y), sides[:2], first, count, every, dtype), x, y, first

        self._table = lru_cache(max(1, kept // (sides[0] * sides[1] * count * dims)))(made)

    def __call__(self, x: int, y: int, sample: int) -> list[float]:
        (left, top, start), (width, height, count) = self._origin, self._sides
        place = (x - left) // width, (y - top) // height, (sample - start) // count
        table, x0, y0, first = self._table(*place)
        return table[y - y0, x - x0, sample - first].tolist()


@jit("dims", "dtype")
def _points(
    sampler: Callable[..., Array], x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike
) -> Array:
    return sampler(x, y, sample, dims, dtype)


def pixel_points(
    sampler: Callable[..., Array],
    corner: tuple[int, int],
    size: tuple[int, int],
    first: int,
    count: int,
    dims: tuple[int, ...],
    dtype: DTypeLike,
) -> NDArray:
    """Return the points of valid pixels and samples: array of shape (rows, columns, count, len(dims)).

    ``corner`` and ``size`` of the rectangle: columns first.
    """
    (x, y), (width, height) = corner, size
    rows = max(1, min(height, PIECE // (width * count * len(dims))))
    found = np.empty((height, width, count, len(dims)), dtype)
    row, column, sample = np.ogrid[:rows, :width, :count]
    column, sample = (column + x).astype(np.uint32), (sample + first).astype(np.uint32)
    with checks.precision(dtype):
        for start in range(0, height, rows):
            # The last piece starts early enough to be as large as the others, to share one program.
            top = min(start, height - rows)
            at = column, (row + y + top).astype(np.uint32), sample
            found[top : top + rows] = np.asarray(_points(sampler, *at, dims, np.dtype(dtype)))
    return found
