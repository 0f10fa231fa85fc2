"""Progressive multi-jittered (0,2)-sequences."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks, draws
from qmcjax.sequences._protocol.plug_in import Tabulated
from qmcjax.sequences._stochastic.net_by_net import checked_size, draw, to_earlier


def pmj02(n: int, key: Array | int) -> Tabulated:
    """Make the first n points of a progressive multi-jittered (0,2)-sequence.

    Every aligned block of 2**m points is a (0,m,2)-net. The first N = 4**k points have one point in each of
    2**k by 2**k squares. Point N + i is in the square of point i for i < N, diagonally opposite within it;
    point 2 N + i is in one of the two remaining quarters, and point 3 N + i in the other.

    Parameters
    ----------
    n : int, in [1, 2**24]; the points of a smaller n are the first of a larger one
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile

    Returns
    -------
    Tabulated, two dimensions

    Notes
    -----
    In [1]_ each square chooses which quarter comes third. Here a random bit makes one choice for all squares
    of one size, horizontally or vertically next to their first point: otherwise the points from 2 N to 3 N
    would not be a net.

    The renumbered Sobol' sequence has this order. Read the digits of an index as a polynomial over F2, i_0 +
    i_1 x + i_2 x^2 + ...: the digits of the second coordinate are its coefficients in powers of x + 1. So a
    point is in the first of the 2**k by 2**k squares if x^k (x + 1)^k divides its polynomial. In the new
    index, digit 2 k stands for this product, and digit 2 k + 1 for the product times x or times x + 1. Then
    the points are scrambled net by net [2]_.

    References
    ----------
    .. [1] P. Christensen, A. Kensler, C. Kilpatrick, "Progressive Multi-Jittered Sample Sequences", 2018.
    .. [2] A. Helmer, P. Christensen, A. Kensler, "Stochastic Generation of (t, s) Sample Sequences", 2021.

    Examples
    --------
    >>> points = pmj02(4, key=0).points(4)
    >>> print(((points[0] < 0.5) != (points[1] < 0.5)).tolist())
    [True, True]
    """
    n = checked_size(n, 2)
    choices_key, points_key = draws.split(checks.prng_key("key", key))
    # If the factor is x + 1 instead of x, digit 2 k + 1 of the index is added to digit 2 k.
    choices = draws.bits(choices_key, (), jnp.uint32) & np.uint32(0x55555555)
    steps = jnp.asarray(_steps())
    return draw(steps ^ (steps >> 1 & choices), points_key, n)


@cache
def _steps() -> NDArray[np.uint32]:
    """Return the maps from indices to those of earlier points, for the factor x at all levels."""
    columns = np.empty((2, 32), np.uint32)
    polynomial = 1
    for k in range(16):
        times_x = polynomial << 1
        # In powers of x + 1, x becomes x + 1 and vice versa.
        columns[:, 2 * k] = _reversed(polynomial)
        columns[:, 2 * k + 1] = _reversed(times_x), _reversed(times_x ^ polynomial)
        polynomial = (times_x ^ polynomial) << 1
    with jax.ensure_compile_time_eval():
        return np.asarray(to_earlier(columns))


def _reversed(word: int) -> int:
    return int(f"{word:032b}"[::-1], 2)
