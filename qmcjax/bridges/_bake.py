"""Tables of the points of samplers, for textures of other programs."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._exr import write_exr
from qmcjax.bridges._images import encode_png, write_bytes
from qmcjax.bridges._plain import pixel_points
from qmcjax.core import checks
from qmcjax.samplers import SamplerLike, as_sampler

MOST = 2**27
"""Maximum number of coordinates of a table, which take 1 GiB in float64."""

_DTYPES = {8: np.uint8, 16: np.uint16, 24: np.float32, 32: np.uint32}
_DEPTHS = {".png": (8, 16), ".exr": (24,)}
_LONGEST = 300


@dataclass(frozen=True, eq=False)
class BakedTable:
    """The result of :func:`bake`: an array, which can be saved as a texture."""

    values: NDArray = field(repr=False)
    """uint8, uint16, uint32 or (for 24 bits) float32, shape (rows, columns, samples, coordinates)."""
    bits: int
    """8, 16 or 32 for unsigned integers; 24 for floats, exactly."""
    about: str
    """A description of the points."""

    @property
    def points(self) -> NDArray:
        """The coordinates that values stand for: float32, and for 32 bits float64, exact.

        For 8 and 16 bits they are the centres of the intervals of values, ``(value + 1/2) / 2**bits``, which
        makes means correct; for 24 and 32 bits the lower bounds, the numbers of the sampler.
        """
        if self.bits == 24:
            return self.values
        if self.bits == 32:
            return self.values * 2.0**-32
        return (self.values.astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-self.bits)

    @property
    def readme(self) -> str:
        """The description that is written to files, with the place of each value."""
        rows, columns, samples, coordinates = self.values.shape
        meaning = {24: "the value", 32: "value / 2**32"}.get(self.bits, f"(value + 1/2) / 2**{self.bits}")
        (groups, across, down), channels = self._layout, self._channels
        return (
            f"{self.about}\n"
            f"Pixels: {columns} x {rows}. Samples of each: {samples}. Values of a sample: {coordinates}.\n"
            f"A coordinate is {meaning}.\n"
            f"Texels: {across * columns} x {down * rows}, from the top. Sample s of pixel (x, y) has value j "
            f"in column (l % {across}) * {columns} + x % {columns} and row (l / {across}) * {rows} + y % "
            f"{rows}, rounded down, with l = {groups} * s + j / {channels}, and in channel j % {channels} of "
            f"{', '.join(('red', 'green', 'blue', 'alpha')[:channels])}."
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write a texture that includes a description of the table.

        Parameters
        ----------
        path : path
            Ends in ``.png``, for 8 or 16 bits, with two coordinates as red and green (a single one as grey)
            and linear values; or ``.exr`` (``pip install 'qmcjax[exr]'``), for 24 bits, with four coordinates
            as red, green, blue and alpha in float32. ``readme`` describes the places.
        """
        path = checks.path(path)
        suffix = checks.suffix_of(path, tuple(_DEPTHS))
        if self.bits not in _DEPTHS[suffix]:
            raise ValueError(f"bits must be one of {_DEPTHS[suffix]} for {suffix}, got {self.bits}")
        if suffix == ".exr":
            write_exr(path, self._texels, self.readme)
        else:
            single = self.values.shape[3] == 1
            texels = self._texels[..., :1] if single else np.pad(self._texels, [(0, 0), (0, 0), (0, 1)])
            texts = {"Software": "qmcjax", "Description": self.readme}
            write_bytes(path, encode_png(texels, texts, "linear"))

    @property
    def _channels(self) -> int:
        return 4 if self.bits == 24 else 2

    @property
    def _layout(self) -> tuple[int, int, int]:
        """The layers of a sample, each a tile with some coordinates as channels; and columns and rows of all.

        The columns are a power of two, for a texture that is about square.
        """
        groups = -(-self.values.shape[3] // self._channels)
        layers = self.values.shape[2] * groups
        across = 1 << (layers - 1).bit_length() // 2
        return groups, across, -(-layers // across)

    @property
    def _texels(self) -> NDArray:
        """The values, shape (height, width, channels); unused texels are 0."""
        rows, columns, _, coordinates = self.values.shape
        groups, across, down = self._layout
        ends = [(0, 0)] * 3
        full = np.pad(self.values, [*ends, (0, groups * self._channels - coordinates)])
        split = full.reshape(rows, columns, -1, self._channels)
        layers = np.pad(split, [*ends[:2], (0, down * across - split.shape[2]), (0, 0)])
        placed = layers.reshape(rows, columns, down, across, -1).transpose(2, 0, 3, 1, 4)
        return placed.reshape(down * rows, across * columns, -1)


def bake(
    sampler: SamplerLike, tile: tuple[int, int], spp: int, dims: tuple[int, ...] = (0, 1), bits: int = 16
) -> BakedTable:
    """Make a table of the points of a sampler, for shaders and other programs.

    Parameters
    ----------
    sampler : Sampler
        Any object that implements the protocol. In base 2 the table has the exact leading bits of its points.
    tile : tuple of int
        Columns and rows of the pixels, starting at (0, 0). Programs repeat the tile.
    spp : int, samples per pixel, from 0 on
    dims : tuple of int
        The coordinates.
    bits : {8, 16, 24, 32}
        Bits per value: unsigned integers, or floats for 24 bits. They must suffice for the strata of a pixel,
        so ``spp`` is less than ``2**(bits + 1)``.

    Notes
    -----
    :func:`source` writes the sampler itself as source code, with all bits, for all pixels, samples and keys.
    Prefer it if arithmetic is faster than memory, or if the tile would be large.

    Coordinates are truncated, not rounded, to keep each point in its elementary intervals down to a side of
    ``2**-bits``. All points of the tile together may form a finer net, which is then lost.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.independent(sequences.sobol(2), key=1)
    >>> table = bake(sampler, tile=(64, 64), spp=4)
    >>> print(table.values.dtype, table.values.shape)
    uint16 (64, 64, 4, 2)
    >>> print(table.values[5, 3, 1], sampler(3, 5, 1) * 2**16)
    [37938 36463] [37938.754 36463.477]
    """
    sampler = as_sampler("sampler", sampler)
    width, height = _size(tile)
    spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT)
    wanted = checks.dimensions(dims, sampler.dims)
    if checks.integer("bits", bits, 8, 32) not in _DTYPES:
        raise ValueError(f"bits must be one of {tuple(_DTYPES)}, got {bits}")
    sampler.check(width, height, spp)
    if width * height * spp * len(wanted) > MOST:
        raise ValueError(
            f"tile, spp and dims must make at most {MOST} coordinates, got {width} x {height} pixels, {spp} "
            f"samples and {len(wanted)} dimensions"
        )
    if spp >= 2 ** (bits + 1):
        raise ValueError(f"bits must be more than {bits} for strata of {spp} samples")
    points = pixel_points(sampler.up_to(spp), (0, 0), (width, height), 0, spp, wanted, np.float64)
    values = np.floor(points * 2.0**bits) * (2.0**-24 if bits == 24 else 1)
    text = repr(sampler)
    text = checks.shown(sampler) if "\n" in text or len(text) > _LONGEST else text
    about = f"Coordinates {', '.join(map(str, wanted))} of the points of a sampler, by qmcjax: {text}."
    return BakedTable(values.astype(_DTYPES[bits]), int(bits), about)


def _size(tile: Iterable[int]) -> tuple[int, int]:
    try:
        width, height = tile
    except (TypeError, ValueError):
        raise TypeError(f"tile must be two integers, columns and rows, got {checks.shown(tile)}") from None
    most = checks.MAX_SIDE
    return checks.integer("tile", width, 1, most), checks.integer("tile", height, 1, most)
