"""Tables of samplers, masks, keys and orders, for lookup by other programs."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.bridges._plain import pixel_points
from qmcjax.bridges._table import BakedTable, make_table
from qmcjax.core import checks
from qmcjax.orders import OrderLike, as_order
from qmcjax.samplers import Ranked, SamplerLike, as_sampler
from qmcjax.sequences import BinarySequence

MOST = 2**27
"""Maximum number of coordinates of a table, which take 1 GiB in float64."""

_BITS = (8, 16, 24, 32)
_LONGEST = 300


def bake(
    sampler: SamplerLike, tile: tuple[int, int], spp: int, dims: tuple[int, ...] = (0, 1), bits: int = 16
) -> BakedTable:
    """Make a table of the points of a sampler, for shaders and other programs.

    Parameters
    ----------
    sampler : Sampler
        Any object that implements the protocol. In base 2 the table has the exact leading bits of its points.
    tile : tuple of int
        Columns and rows of the pixels, starting at (0, 0). Readers repeat the tile.
    spp : int, samples per pixel, from 0 on
    dims : tuple of int
        The coordinates.
    bits : {8, 16, 24, 32}
        Bits per value: unsigned integers, or floats for 24 bits. They must suffice for the strata of a pixel.
        See :class:`BakedTable` for the file formats.

    Notes
    -----
    :func:`source` writes the sampler itself as source code, with all bits, for all pixels, samples and keys.
    Prefer it if arithmetic is faster than memory, or if the tile would be large.

    Coordinates are truncated, not rounded, to keep each point in its elementary intervals down to a side of
    ``2**-bits``: in all of them if spp = 2**m <= 2**bits. For more samples, the points of pixels are counted
    in elementary intervals of volume 2**-m of the first and second coordinate, the third and fourth, ...,
    before and after truncation; if fewer intervals contain a point, this is an error. All points of the tile
    together are counted, too: losses are noted in ``about``, since a net over the tile may be finer.

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
    bits = _check_bits(bits)
    sampler.check(width, height, spp)
    if width * height * spp * len(wanted) > MOST:
        raise ValueError(
            f"tile, spp and dims must make at most {MOST} coordinates, got {width} x {height} pixels, {spp} "
            f"samples and {len(wanted)} dimensions"
        )
    points = pixel_points(sampler.up_to(spp), (0, 0), (width, height), 0, spp, wanted, np.float64)
    words = (points * 2.0**32).astype(np.uint32)
    lost = broken_strata(words.reshape(width * height, spp, -1), bits)
    if lost is not None:
        raise ValueError(f"bits must be more than {bits} for strata of {spp} samples: {lost}")
    about = (
        f"Points of a sampler, by qmcjax: {_describe(sampler)}.",
        f"Coordinates: {', '.join(map(str, wanted))} of the sampler's.",
        _of_tile(words, bits),
    )
    return make_table(words, bits, True, about)


def _of_tile(words: NDArray[np.uint32], bits: int) -> str:
    """Return a note on the strata of all points together."""
    lost = broken_strata(words.reshape(1, -1, words.shape[-1]), bits)
    if lost is None:
        return "All points together keep their elementary intervals."
    return f"Finer than {bits} bits are all points together: {lost}."


def bake_mask(mask: ArrayLike, bits: int = 16) -> BakedTable:
    """Make a table of a mask, such as that of :func:`qmcjax.samplers.blue_noise_mask`.

    Parameters
    ----------
    mask : float ArrayLike, shape (rows, columns) or (rows, columns, channels), in [0, 1)
    bits : {8, 16, 24, 32}, bits per value, truncated as by :func:`bake`

    Returns
    -------
    BakedTable, with one sample, and channels as coordinates

    Examples
    --------
    >>> from qmcjax import samplers
    >>> table = bake_mask(samplers.blue_noise_mask(1), bits=8)
    >>> print(table.values.shape)
    (128, 128, 1, 1)
    >>> print(table.about[-1])
    Finer than 8 bits are all points together: of the boxes 1/16384 x 1 16384 have a point, 256 as stored.
    """
    known = checks.known_array("mask", mask, np.floating, "floats of shape (rows, columns[, channels])")
    known = known.astype(np.float64)
    if known.ndim not in (2, 3) or not known.size:
        raise ValueError(f"mask must have the shape (rows, columns[, channels]), got {known.shape}")
    outside = ~((known >= 0) & (known < 1))
    if outside.any():
        raise ValueError(f"mask must be in [0, 1), got {known[outside][0]}")
    bits = _check_bits(bits)
    words = (known.reshape(*known.shape[:2], 1, -1) * 2.0**32).astype(np.uint32)
    return make_table(words, bits, True, ("A mask, by qmcjax.", _of_tile(words, bits)))


def bake_order(order: OrderLike) -> BakedTable:
    """Make a table of the positions of pixels on a curve.

    Parameters
    ----------
    order : Order, any object that implements the protocol, of at most 2**27 pixels

    Returns
    -------
    BakedTable
        Integers, one per pixel, in the smallest of 8, 16 or 32 bits that suffice for the order's length.

    Examples
    --------
    >>> from qmcjax import orders
    >>> print(bake_order(orders.hilbert(4, 4)).values[..., 0, 0])
    [[ 0  1 14 15]
     [ 3  2 13 12]
     [ 4  7  8 11]
     [ 5  6  9 10]]
    """
    order = as_order("order", order)
    if order.width * order.height > MOST:
        raise ValueError(f"order must have at most {MOST} pixels, got {order.width} x {order.height}")
    y, x = np.mgrid[: order.height, : order.width].astype(np.uint32)
    positions = np.asarray(order.position(x, y))[..., None, None]
    bits = next(bits for bits in (8, 16, 32) if order.length <= 2**bits)
    return make_table(positions, bits, False, (f"Positions of pixels, by qmcjax: {_describe(order)}.",))


def bake_matrices(sequence: Any) -> BakedTable:
    """Make a table of generator matrices, for programs that compute points of a digital sequence.

    Parameters
    ----------
    sequence : Digital
        A digital sequence in base 2, such as :func:`qmcjax.sequences.sobol`.

    Returns
    -------
    BakedTable
        32-bit integers, for one pixel: "sample" j contains the 32 columns of matrix j, with the first row in
        bit 31. Coordinate j of point i, as a 32-bit fraction, is the xor of all columns k with bit k of i
        set.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> columns = bake_matrices(sequences.sobol(3)).values[0, 0]
    >>> print(columns[2, 0] ^ columns[2, 2], sequences.sobol(3).bits(5)[2])
    3758096384 3758096384
    """
    matrices = getattr(sequence, "matrices", None)
    if not isinstance(sequence, BinarySequence) or matrices is None:
        raise TypeError(f"sequence must be a digital sequence in base 2, got {checks.shown(sequence)}")
    about = (
        f"Generator matrices, by qmcjax: {_describe(sequence)}.",
        "Value k of sample j is column k of matrix j, its first row in bit 31.",
    )
    return make_table(np.asarray(matrices)[None, None], 32, False, about)


def bake_ranked(sampler: Ranked, spp: int) -> tuple[BakedTable, BakedTable]:
    """Make the tables of a ranked sampler: its ranking and scrambling keys, and the points of its sequence.

    Parameters
    ----------
    sampler : Ranked, from :func:`qmcjax.samplers.ranked`
    spp : int, maximum number of samples of a pixel, in [1, 65536]

    Returns
    -------
    keys : BakedTable
        16-bit integers: coordinate 0 is the ranking key of a pixel, j + 1 the scrambling key of dimension j.
    sequence : BakedTable
        16-bit integers: the points, as samples of one pixel. Their number is a power of two, and keys permute
        them. As 16-bit fractions, coordinate j of sample s of a pixel is
        ``sequence[s ^ keys[0]][j] ^ keys[j + 1]``.

    Examples
    --------
    >>> from qmcjax import samplers
    >>> sampler = samplers.ranked(2, key=1)
    >>> keys, sequence = bake_ranked(sampler, 16)
    >>> rank, scramble = keys.values[5, 3, 0, 0], keys.values[5, 3, 0, 2]
    >>> print(sequence.values[0, 0, 7 ^ rank, 1] ^ scramble, int(sampler(3, 5, 7)[1] * 2**16))
    18637 18637
    """
    if not isinstance(sampler, Ranked):
        raise TypeError(f"sampler must be one of samplers.ranked, got {checks.shown(sampler)}")
    spp = checks.integer("spp", spp, 1, 2**16)
    rows, columns = sampler.ranks.shape
    dx, dy = map(int, np.asarray(sampler.translation))
    place = np.ix_((np.arange(rows) + dy % rows) % rows, (np.arange(columns) + dx % columns) % columns)
    ranks, scrambles = np.asarray(sampler.ranks)[place], np.asarray(sampler.scrambles)[place]
    keys = np.concatenate([ranks[..., None], scrambles >> np.uint32(16)], axis=-1)
    count = 1 << int(max(ranks.max(), spp - 1)).bit_length()
    words = np.asarray(sampler.sequence.bits(np.arange(count, dtype=np.uint32))) >> np.uint32(16)
    made = f"by qmcjax: {_describe(sampler)}."
    return (
        make_table(keys[:, :, None, :], 16, False, (f"A ranking key and scrambling keys, {made}",)),
        make_table(words[None, None], 16, False, (f"Points of the sequence of ranked samples, {made}",)),
    )


def _describe(noun: Any) -> str:
    """Return a description of an object for a file: its repr if that is one line."""
    text = repr(noun)
    return checks.shown(noun) if "\n" in text or len(text) > _LONGEST else text


def _size(tile: Iterable[int]) -> tuple[int, int]:
    try:
        width, height = tile
    except (TypeError, ValueError):
        raise TypeError(f"tile must be two integers, columns and rows, got {checks.shown(tile)}") from None
    most = checks.MAX_SIDE
    return checks.integer("tile", width, 1, most), checks.integer("tile", height, 1, most)


def _check_bits(bits: int) -> int:
    if checks.integer("bits", bits, 8, 32) not in _BITS:
        raise ValueError(f"bits must be one of {_BITS}, got {bits}")
    return int(bits)


class Broken(NamedTuple):
    """A shape of boxes, fewer of which contain a point after truncation."""

    log_width: int
    log_height: int
    """The boxes are 2**-log_width wide and 2**-log_height high."""
    before: int
    stored: int
    """Number of boxes with a point, over all sets."""

    def __str__(self) -> str:
        size = f"{_length(self.log_width)} x {_length(self.log_height)}"
        return f"of the boxes {size} {self.before} have a point, {self.stored} as stored"


def _length(log: int) -> str:
    return f"1/{2**log}" if log else "1"


def broken_strata(words: NDArray[np.uint32], bits: int) -> Broken | None:
    """Return the shape of boxes that loses most if only the leading bits of coordinates are kept.

    ``words``: uint32 array, shape (sets, n, dims): 32-bit fractions. Boxes have volume 2**-m, where 2**m is
    the largest power of two up to n, in the coordinates 0 and 1, 2 and 3, ...; intervals of single
    coordinates are the most slender boxes. ``bits``: number of bits that are kept.

    Notes
    -----
    The first k digits determine the position on a grid of side 2**-k. So no box with k <= ``bits`` on both
    sides gains or loses a point, and only the others need to be counted.
    """
    found = [Broken(*shape, *_counts(words, pair, shape, bits)) for pair, shape in _finer(words.shape, bits)]
    lost = [each for each in found if each.stored < each.before]
    return max(lost, key=lambda each: each.before / each.stored, default=None)


def _finer(shape: tuple[int, ...], bits: int) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Yield pairs of coordinates and shapes of boxes with a side finer than 2**-bits."""
    m = shape[1].bit_length() - 1
    for j in range(0, shape[2], 2):
        for a in range(m + 1):
            # The last coordinate of an odd number has intervals only.
            if max(a, m - a) > bits and (j + 1 < shape[2] or a == m):
                yield (j, min(j + 1, shape[2] - 1)), (a, m - a)


def _counts(
    words: NDArray[np.uint32], pair: tuple[int, int], shape: tuple[int, int], bits: int
) -> tuple[int, int]:
    """Return the number of boxes with a point before and after truncation to the leading bits."""
    wide = words[..., pair].astype(np.uint64)
    kept = wide >> np.uint64(32 - bits) << np.uint64(32 - bits)
    return _occupied(wide, shape), _occupied(kept, shape)


def _occupied(words: NDArray[np.uint64], shape: tuple[int, int]) -> int:
    x, y = (words[..., j] >> np.uint64(32 - shape[j]) for j in (0, 1))
    boxes = np.sort((x << np.uint64(shape[1])) | y, axis=1)
    return int(np.sum(boxes[:, 1:] != boxes[:, :-1]) + len(boxes))
