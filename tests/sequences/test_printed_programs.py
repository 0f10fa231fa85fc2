"""The printed programs from pixel to index (thesis, Sect. 5.2.4 and 5.2.5), in Python: names are theirs."""

from functools import cache
from math import comb

import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import sequences

WORD = 2**32 - 1


def larcher_pillichshammer(i):
    r, v = 0, 1 << 31
    while i:
        r ^= v * (i & 1)
        i, v = i >> 1, v | v >> 1
    return r


def larcher_pillichshammer_inverse(i):
    r, v = 0, 3 << 30
    while i:
        r ^= v * (i & 1)
        i, v = i >> 1, v >> 1
    return r


def van_der_corput(i):
    return int(format(i, "032b")[::-1], 2)


def sobol(i):
    r, v = 0, 1 << 31
    while i:
        r ^= v * (i & 1)
        i, v = i >> 1, v ^ v >> 1
    return r


def sobol_inverse(i):
    r, v = 0, 1
    while i:
        r ^= v * (i >> 31)
        i, v = i << 1 & WORD, (v ^ v << 1) & WORD
    return r


@cache
def tables_of_a_net(m):
    low, high = ([larcher_pillichshammer(i << k) >> 32 - 2 * m for i in range(2**m)] for k in (0, m))
    return low, {k >> m: i for i, k in enumerate(low)}, high


def look_up(m, ex, ey):
    c1_lower, c1_lower_inverse, c1_upper = tables_of_a_net(m)
    lower = c1_lower_inverse[ey ^ c1_upper[ex] >> m]
    return ex << m | lower, c1_upper[ex] ^ c1_lower[lower]


def compute(m, ex, ey, mask):
    lp_upper = larcher_pillichshammer(ex << m) >> 32 - 2 * m
    lower = larcher_pillichshammer_inverse((ey ^ lp_upper >> m) << 32 - m)
    return ex << m | lower, ey << m | lp_upper & mask


def compute_scrambled(m, ex, ey, scramble_x, scramble_y):
    upper = (ex ^ scramble_x >> 32 - m) << m
    lp_upper = larcher_pillichshammer(upper) ^ scramble_y
    delta = ey << 32 - m ^ lp_upper & 2**m - 1 << 32 - m
    index = upper | larcher_pillichshammer_inverse(delta)
    return index, index << 32 - 2 * m ^ scramble_x, lp_upper ^ delta


@cache
def tables_of_a_frame(m, frame):
    c0_upper, c1_upper = ([f(i << m | frame << 2 * m) for i in range(2**m)] for f in (van_der_corput, sobol))
    return c0_upper, c1_upper, {k >> 32 - m: i for i, k in enumerate(c1_upper)}


def look_up_frame(m, frame, ex, ey):
    c0_upper, c1_upper, c1_upper_inverse = tables_of_a_frame(m, frame)
    lower = van_der_corput(ex << 32 - m)  # A table holds it as well.
    upper = c1_upper_inverse[ey ^ sobol(lower) >> 32 - m]
    index = upper << m | lower | frame << 2 * m
    return index, van_der_corput(lower) ^ c0_upper[upper], sobol(lower) ^ c1_upper[upper]


def compute_frame(m, frame, ex, ey):
    shift, lower = frame << 2 * m, van_der_corput(ex << 32 - m)
    delta = (ey << 32 - m ^ sobol(lower) ^ sobol(shift)) & 2**m - 1 << 32 - m
    result = delta | delta >> m
    index = shift | sobol_inverse(result) | lower
    return index, van_der_corput(index), sobol(shift) ^ result ^ sobol(lower)


def ours(seq, m, cells):
    """Return the index and the first two words of the point of each cell (x, y, sample)."""
    x, y, sample = jnp.asarray(np.array(cells, np.uint32).T)
    index = sequences.inverted(seq, m).index_in_cell(x, y, m, sample)
    return np.column_stack([index, seq.bits(index, (0, 1))]).tolist()


@pytest.mark.parametrize("m", [1, 3, 8])
def test_programs_of_a_net(m):
    """Sect. 5.2.4. Only with a minus that the text has elsewhere, ~-, is y right without tables."""
    cells = [(3 * k % 2**m, 5 * k // 3 % 2**m, 0) for k in range(64)]
    net, scale = sequences.larcher_pillichshammer_net(2 * m), 32 - 2 * m
    expected = [(x >> scale, y >> scale) for _, x, y in ours(net, m, cells)]
    assert [look_up(m, ex, ey) for ex, ey, _ in cells] == expected
    assert [compute(m, ex, ey, ~-(1 << m)) for ex, ey, _ in cells] == expected
    printed = [compute(m, ex, ey, ~(1 << m)) for ex, ey, _ in cells]
    assert [x for x, _ in printed] == [x for x, _ in expected] and (printed == expected) == (m == 1)
    moved = sequences.digital_shift(net, key=m)
    scrambled = [list(compute_scrambled(m, ex, ey, *moved.f.shifts.tolist())) for ex, ey, _ in cells]
    assert scrambled == ours(moved, m, cells)


@pytest.mark.parametrize("m", range(1, 9))
def test_programs_of_frames(m):
    """Sect. 5.2.5: with tables for all m; without, by Eq. 5.26, for powers of two only."""
    cells = [(3 * k % 2**m, 5 * k // 3 % 2**m, k % 3) for k in range(64)]
    expected = ours(sequences.sobol(2), m, cells)
    assert [list(look_up_frame(m, frame, ex, ey)) for ex, ey, frame in cells] == expected
    without = [list(compute_frame(m, frame, ex, ey)) for ex, ey, frame in cells]
    assert (without == expected) == (m in (1, 2, 4, 8))


def test_equation_5_26():
    """The matrix of the second component, of 2 m rows, is (A A; 0 A) for powers of two only."""
    columns = np.asarray(sequences.sobol(2).matrices)[1]
    matrix = columns >> np.arange(31, -1, -1, dtype=np.uint32)[:, None] & 1
    assert all(matrix[i, j] == comb(j, i) % 2 for i in range(32) for j in range(32))
    blocks = {m: [matrix[:m, m : 2 * m], matrix[m : 2 * m, m : 2 * m]] for m in range(1, 17)}
    held = [m for m, of in blocks.items() if all(np.array_equal(matrix[:m, :m], block) for block in of)]
    assert held == [1, 2, 4, 8, 16] and not np.tril(matrix, -1).any()
