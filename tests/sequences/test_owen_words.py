"""Words that scramble: empty buckets and bias of hashes, and the flips of symbols, exactly.

Words are bit-reversed, their first digit in bit 0. A coin is the flip of a digit after a prefix, over many
seeds. All bounds are 5 standard deviations, the seeds are always the same.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import rank
from scipy.spatial.distance import pdist
from tables import slow

from qmcjax import sequences
from qmcjax.core import number_theory
from qmcjax.core.bits import hash_word, owen_hash
from qmcjax.sequences._scrambling.owen import with_tables

SEEDS = jax.random.bits(jax.random.key(8), (2**16,), jnp.uint32)


def laine_karras(word, seed):
    """Return the hash of B. Burley, "Practical Hash-based Owen Scrambling", 2020, after Laine and Karras."""
    word = word + seed
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        word = word ^ (word * np.uint32(factor))
    return word


HASHES = {"owen_hash": owen_hash, "laine_karras": laine_karras}
"""The other one fails where parities or neighbours are looked at."""

hashes = pytest.mark.parametrize("name", HASHES)
PREFIX = 0x9D3C5A71
WORDS = (0, 123, PREFIX, 2**32 - 1)
DEPTHS = (0, 1, 2, 3, 5, 8, 12, 20, 29)
TOP = [(prefix, depth) for depth in range(5) for prefix in range(2**depth)]
NODES = [*TOP, *((PREFIX & (2**depth - 1), depth) for depth in range(5, 32))]


def hashed(name, words) -> np.ndarray:
    """Return the words after the hash, uint32 (words, seeds)."""
    words = jnp.asarray(np.array(words, np.uint32))
    return np.asarray(jax.jit(HASHES[name])(words[:, None], SEEDS[None]))


def coins(name, nodes) -> np.ndarray:
    """Return the flips at nodes (prefix, depth), uint32 (nodes, seeds)."""
    prefix, depth = np.array(nodes, np.uint32).T
    return ((hashed(name, prefix) ^ prefix[:, None]) >> depth[:, None]) & np.uint32(1)


def below(depth, levels):
    """Return the nodes of some levels from a prefix of so many digits on."""
    prefix = PREFIX & (2**depth - 1)
    return [(prefix | q << depth, depth + level) for level in range(levels) for q in range(2**level)]


def numbered(digits):
    """Return each column of binary digits as a number."""
    return (digits.astype(np.int64) << np.arange(len(digits))[:, None]).sum(axis=0)


def buckets(numbers, count):
    """Return how many buckets are empty, and by how many deviations chi-squared is off its mean."""
    found, expected = np.bincount(numbers, minlength=count), len(numbers) / count
    statistic = ((found - expected) ** 2 / expected).sum()
    return int((found == 0).sum()), abs(statistic - (count - 1)) / np.sqrt(2 * (count - 1))


@hashes
def test_eight_digits_of_a_point_are_uniform(name):
    """M. Pharr's test, for four points, at four places."""
    for words in hashed(name, WORDS):
        results = [buckets(words >> np.uint32(shift) & np.uint32(255), 256) for shift in (0, 8, 16, 24)]
        assert all(empty == 0 and off < 5 for empty, off in results)


@hashes
def test_three_coins_of_a_node_and_its_children_are_uniform(name):
    """At nine depths, jointly: all eight scramblings of two digits."""
    results = [buckets(numbered(coins(name, below(depth, 2))), 8) for depth in DEPTHS]
    if name == "owen_hash":
        assert all(empty == 0 and off < 5 for empty, off in results)
    else:
        assert max(empty for empty, _ in results) == 4


@hashes
def test_coins_are_fair_and_those_of_any_two_nodes_independent(name):
    """Of all nodes of five levels, and of one on each later level."""
    signs = 1 - 2.0 * coins(name, NODES)
    bias = np.abs(signs.mean(axis=1)).max() * np.sqrt(len(SEEDS))
    correlation = np.abs(1 - pdist(signs, "correlation")).max() * np.sqrt(len(SEEDS))
    assert bias < 5 and (correlation < 5) == (name == "owen_hash")


@hashes
def test_points_that_part_are_independent_in_the_next_five_digits(name):
    results = []
    for depth in (0, 3, 9, 20):
        one, other = hashed(name, [PREFIX, PREFIX ^ 1 << depth])
        results.append(buckets((one ^ other) >> np.uint32(depth + 1) & np.uint32(31), 32))
    assert all(empty == 0 and off < 5 for empty, off in results) == (name == "owen_hash")


@hashes
def test_all_scramblings_of_three_digits_come(name):
    """Which sums and products alone cannot: four coins have another parity than two of the level above."""
    for depth in DEPTHS:
        of_node = coins(name, below(depth, 3))
        parity = of_node[3:].sum(axis=0) + of_node[1:3].sum(axis=0)
        assert len(set((parity & np.uint32(1)).tolist())) == (2 if name == "owen_hash" else 1)
        empty, off = buckets(numbered(of_node), 128)
        assert (empty == 0 and off < 5) if name == "owen_hash" else empty >= 64


@pytest.mark.parametrize("nodes", [TOP[:15], *slow(NODES)], ids=["four", "all"])
def test_any_three_coins_are_independent(nodes):
    """The products of three signs, of the nodes of four levels, and of all above."""
    signs = 1 - 2 * coins("owen_hash", nodes).astype(np.float32)
    for k in range(2, len(signs)):
        products = (signs[:k] * signs[k]) @ signs[:k].T / np.sqrt(len(SEEDS))
        assert np.abs(products[~np.eye(k, dtype=bool)]).max() < 5


@partial(jax.jit, static_argnames="depth")
def four_digits(seeds, depth):
    """Return the numbers of the scramblings of four digits, of which there are 2**15, after a prefix."""
    number = jnp.zeros_like(seeds)
    for k, (prefix, level) in enumerate(below(depth, 4)):
        flip = (owen_hash(jnp.uint32(prefix), seeds) ^ np.uint32(prefix)) >> level & np.uint32(1)
        number = number | flip << k
    return number


@pytest.mark.parametrize("depth", [0, *slow(1, 7, 28)])
def test_all_scramblings_of_four_digits_come_and_no_parity_is_far_off(depth):
    """Over 2**22 seeds: random draws would reach all, too. A parity is of any set of the 15 coins."""
    counts = np.zeros(2**15)
    for k in range(4):
        seeds = hash_word(jnp.arange(k << 20, (k + 1) << 20, dtype=jnp.uint32))
        counts += np.bincount(four_digits(seeds, depth), minlength=2**15)
    assert counts.min() > 0
    parities = counts.reshape((2,) * 15)
    for axis in range(15):
        even, odd = np.moveaxis(parities, axis, 0)
        parities = np.stack([even + odd, even - odd], axis)
    parities = np.abs(parities.ravel()[1:]) / 2**22
    # Few are off at all: the squares of draws' parities add up to 2**-7.
    assert parities.max() < 1 / 8 + 5 / 2**11
    assert np.square(parities).sum() < 0.08


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


@pytest.mark.parametrize("digits", [4, *slow(8)])
def test_tables_give_the_flips_of_the_words(digits):
    """Of all 32 digits, by tables of some."""
    words = np.asarray(jax.random.bits(KEY, (1, 64), jnp.uint32)).astype(object)[0]
    all_bits = sum(int(f"{word:032b}"[::-1], 2) << (32 * u) for u, word in enumerate(words))
    prefixes = [int(p) for p in np.random.default_rng(0).integers(0, 2**32, 20)]
    flipped = [[(f & all_bits).bit_count() & 1 for f in flips(p, 32)] for p in prefixes]
    expected = [sum(d << k for k, d in enumerate(of)) ^ p for of, p in zip(flipped, prefixes, strict=True)]
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
