"""Trees along space-filling curves: one order of the boxes, in which nodes are split."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.trees import _boxes
from analysis.trees._structure import Tree
from analysis.trees._sweep import sweep


def hilbert_tree(low: ArrayLike, high: ArrayLike) -> Tree:
    """Make a tree by the surface area heuristic along the Hilbert curve through the centres of boxes.

    The boxes are sorted once, and each node is split where Eq. 4.1 is smallest along that order.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.
    .. [2] J. Skilling, "Programming the Hilbert curve", 2004.

    Examples
    --------
    >>> tree = hilbert_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    return _along(low, high, hilbert_digits)


def morton_tree(low: ArrayLike, high: ArrayLike) -> Tree:
    """Make a tree by the surface area heuristic along the Morton order of the centres of boxes.

    Like :func:`hilbert_tree`, but the curve has jumps.

    Parameters
    ----------
    low, high : float ArrayLike, shape (n, 3) or (n, 4)
        Corners of the boxes; see :func:`surface_area_tree`.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 4.1.3.

    Examples
    --------
    >>> tree = morton_tree([[0, 0, 0], [9, 0, 0], [1, 0, 0]], [[1, 1, 1], [10, 1, 1], [2, 1, 1]])
    >>> print(tree.children.tolist())
    [[0, 2], [3, 1]]
    """
    return _along(low, high, lambda cells, bits: cells)


def _along(low: ArrayLike, high: ArrayLike, digits: Any) -> Tree:
    low, high = _boxes.still_boxes(low, high)
    cells, bits = _cells(low, high)
    return sweep(low, high, np.argsort(_interleave(digits(cells, bits), bits), kind="stable")[None])


def _cells(low: NDArray, high: NDArray) -> tuple[NDArray[np.int64], int]:
    """Return the grid cells of centres, (d, n), and the number of bits per coordinate.

    Cells are cubes in space; time has a separate scale.
    """
    bits = 63 // low.shape[1]
    center = 0.5 * low + 0.5 * high
    least = center.min(axis=0)
    extent = center.max(axis=0) - least
    extent[:3] = extent[:3].max()
    scale = (2**bits * (1 - 1e-12)) / np.where(extent > 0, extent, 1)
    return ((center - least) * scale).astype(np.int64).T, bits


def hilbert_digits(cells: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Return the digits of the positions of cells (d, n) on the Hilbert curve, to be interleaved."""
    x = cells.copy()
    for bit in (1 << k for k in range(bits - 1, 0, -1)):
        for axis in range(len(x)):
            # Where the bit is set the lower bits of the first axis are inverted, else swapped with its own.
            is_set = (x[axis] & bit) != 0
            swapped = np.where(is_set, 0, (x[0] ^ x[axis]) & (bit - 1))
            x[axis] ^= swapped
            x[0] ^= np.where(is_set, bit - 1, swapped)
    for axis in range(1, len(x)):
        x[axis] ^= x[axis - 1]
    turned = np.zeros_like(x[0])
    for bit in (1 << k for k in range(bits - 1, 0, -1)):
        turned ^= np.where((x[-1] & bit) != 0, bit - 1, 0)
    return x ^ turned


def _interleave(numbers: NDArray[np.int64], bits: int) -> NDArray[np.int64]:
    """Interleave the bits of d numbers, those of the first in front."""
    key = np.zeros_like(numbers[0])
    for k in range(bits - 1, -1, -1):
        for number in numbers:
            key = (key << 1) | ((number >> k) & 1)
    return key
