"""The effect of fewer bits on stratification, by counting points in elementary intervals."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Broken(NamedTuple):
    """Boxes of one shape, fewer of which contain a point after truncation."""

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


def broken(words: NDArray[np.uint32], bits: int) -> Broken | None:
    """Return the boxes that lose most if only the leading bits of coordinates are kept.

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
