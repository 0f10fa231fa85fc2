"""Owen scrambling by look-ups: the flips of its words, exactly, and the points of cells."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, slow

from qmcjax import sequences
from qmcjax.core import number_theory
from qmcjax.sequences._scrambling.art_owen import with_tables

KEY = jax.random.key(6)
CHILDREN = number_theory.word_children().tolist()


def flips(prefix, depth):
    """Return the bits of the words that flip digits 0 to depth - 1 after a prefix, one set for each digit.

    Bit b of the word of symbol u is bit 32 u + b of an integer.
    """
    symbol, on_the_way, sums = 0, [], []
    for k in range(depth):
        on_the_way.append(symbol)
        sums.append(sum(1 << (32 * u + k - i) for i, u in enumerate(on_the_way)))
        symbol = CHILDREN[symbol][prefix >> k & 1]
    return sums


def rank(rows):
    """Return the rank of a matrix over F2, whose rows are integers."""
    pivots = {}
    for row in rows:
        while row and (top := row.bit_length()) in pivots:
            row ^= pivots[top]
        if row:
            pivots[top] = row
    return len(pivots)


def test_tables_give_the_flips_of_the_words():
    """Of all 32 digits, by tables of four and of eight digits."""
    words = np.asarray(jax.random.bits(KEY, (1, 64), jnp.uint32)).astype(object)[0]
    all_bits = sum(int(f"{word:032b}"[::-1], 2) << (32 * u) for u, word in enumerate(words))
    prefixes = [int(p) for p in np.random.default_rng(0).integers(0, 2**32, 20)]
    expected = [
        sum(((f & all_bits).bit_count() & 1) << k for k, f in enumerate(flips(p, 32))) ^ p for p in prefixes
    ]
    for digits in (4, 8):
        sequence = with_tables(sequences.sobol(1), KEY, digits)
        found = jax.jit(lambda s, w: s.bit_reversed(w, 0))(sequence, np.array(prefixes, np.uint32))
        assert np.asarray(found).tolist() == expected


def test_any_two_points_are_scrambled_as_by_independent_coins():
    """Exactly: all flips of one and those of the other behind the digit where they part."""
    rng = np.random.default_rng(1)
    for part in range(32):
        for _ in range(2):
            one, other = (int(p) for p in rng.integers(0, 2**32, 2))
            behind = (1 << part) - 1
            other = (one & behind) | ((one ^ (1 << part)) & (1 << part)) | (other & ~behind & ~(1 << part))
            assert rank([*flips(one, 32), *flips(other, 32)[part + 1 :]]) == 32 + 31 - part


def test_many_points_are_not():
    """All nodes of ten levels would be 1023 coins; later ones depend on these words' 2048 bits."""
    counts = [len({tuple(flips(prefix, depth)) for prefix in range(2 ** (depth - 1))}) for depth in (5, 10)]
    assert counts == [16, 512]
    coins = [flips(prefix, depth + 1)[-1] for depth in range(10) for prefix in range(2**depth)]
    assert len(set(coins)) == 1023
    assert rank(coins) < 1023


@pytest.mark.parametrize("log_side", [3, *slow(1, 16)])
def test_the_index_of_the_point_in_each_cell(log_side):
    """In two frames, or the only one."""
    sequence = sequences.art_owen(sequences.digital_shift(sequences.sobol(3), 1), 2)
    cells = sequences.inverted(sequence, log_side)
    places = np.random.default_rng(3).integers(0, 4**log_side, 64) if log_side > 3 else np.arange(4**log_side)
    x, y = (jnp.asarray(a.astype(np.uint32)) for a in divmod(places, 2**log_side))
    for frame in (0, 5) if log_side < 16 else (0,):
        index = jax.jit(cells.index_in_cell, static_argnums=2)(x, y, log_side, jnp.uint32(frame))
        if len(places) == 4**log_side:
            assert np.array_equal(np.sort(index), first(4**log_side) + frame * 4**log_side)
        found = np.asarray(sequence.bits(index)).astype(np.uint64)
        assert np.array_equal(found[:, 0] >> np.uint64(32 - log_side), x)
        assert np.array_equal(found[:, 1] >> np.uint64(32 - log_side), y)
        assert np.array_equal(cells.word(index, 2), found[:, 2])
