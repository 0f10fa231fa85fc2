"""Sequences drawn net by net: nested scramblings of all generators; best candidates; pmj02.

Their distribution is tested in ``test_scramblings``.
"""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import few, first, is_net, slow

from qmcjax import sequences
from qmcjax.core.bits import gray_decode, hash_word
from qmcjax.sequences._scrambling.owen_exact import random_word
from qmcjax.sequences._stochastic.net_by_net import to_earlier

pytestmark = pytest.mark.usefixtures("least_optimized")

KEYS = jax.random.split(jax.random.key(3), 10_000)

SCRAMBLED = {
    "sobol": (lambda: sequences.sobol(3), 200),
    "larcher_pillichshammer": (sequences.larcher_pillichshammer, 300),
    # L C for the lower triangular matrix L of ones.
    "L times sobol": (lambda: sequences.digital(gray_decode(sequences.sobol(3).matrices)), 300),
    "halton": (lambda: sequences.halton(4), 200),
    "faure": (lambda: sequences.faure(3), 60),
    "faure, modified": (lambda: sequences.faure(5, 7, modified=2), 350),
    "van_der_corput(300)": (lambda: sequences.van_der_corput(300), 400),
}


def digits_of(points, base):
    """Return the leading digits that tell points apart, one row each."""
    count = next(k for k in range(33) if base**k >= len(points))
    # Within an interval there is more room than rounding needs.
    number = np.floor(points * float(base) ** count + 1e-9).astype(np.int64)
    return np.stack([number // base ** (count - 1 - k) % base for k in range(count)])


@pytest.mark.parametrize("name", few(SCRAMBLED, "sobol", "faure"))
def test_digits_are_permuted_as_the_digits_before_them_decide(name):
    """The definition of nested scrambling, against the points themselves: so all nets stay nets."""
    make, n = SCRAMBLED[name]
    sequence = make()
    drawn = sequences.net_by_net(sequence, n, key=5)
    plain, scrambled = (np.asarray(s.points(n, dtype=jnp.float64)) for s in (sequence, drawn))
    for dim, base in enumerate(getattr(sequence, "bases", (2,) * sequence.dims)):
        before, after = digits_of(plain[:, dim], base), digits_of(scrambled[:, dim], base)
        for k in range(len(before)):
            images, origins = {}, {}
            for node, digit, image in zip(map(tuple, before[:k].T), before[k], after[k], strict=True):
                assert images.setdefault((node, digit), image) == image
                assert origins.setdefault((node, image), digit) == digit


@pytest.mark.parametrize("name", slow("sobol", "L times sobol", "halton"))
def test_points_made_in_a_program_are_the_same(name):
    """All of it, the sequence too."""
    make, n = SCRAMBLED[name]
    inside = jax.jit(lambda key: sequences.net_by_net(make(), n, key).table)(KEYS[0])
    assert np.array_equal(inside, sequences.net_by_net(make(), n, KEYS[0]).table)


@pytest.mark.slow
def test_fewer_points_are_the_first():
    for sequence in (sequences.sobol(3), sequences.halton(3)):
        table = sequences.net_by_net(sequence, 200, key=1).table
        assert all(
            np.array_equal(sequences.net_by_net(sequence, n, key=1).table, table[:n]) for n in (1, 2, 77)
        )
    table = sequences.pmj02(300, 1, candidates=5).table
    assert np.array_equal(sequences.pmj02(77, 1, candidates=5).table, table[:77])


def orders_of_quadrants(points, levels):
    """Check what defines a progressive multi-jittered (0,2)-sequence; return which quadrants come third."""
    n = 4**levels
    for m in range(1, 2 * levels + 1):
        assert all(is_net(points[start : start + 2**m], m) for start in range(0, n, 2**m))
    orders = []
    for k in range(levels):
        one, second, third, fourth = (points >> np.uint32(31 - k))[: 4 ** (k + 1)].reshape(4, -1, 2)
        assert np.array_equal(one ^ np.uint32(1), second)
        assert np.array_equal(third ^ np.uint32(1), fourth)
        (order,) = {tuple(step) for step in (one ^ third).tolist()}
        orders.append(order)
    return tuple(orders)


@pytest.mark.slow
@pytest.mark.parametrize("levels", [2, 4])
def test_pmj02_are_nets_whose_points_alternate_on_diagonals(levels):
    """With all orders, as often as not beside the first point."""
    count = 20 * 2**levels
    tables = np.asarray(jax.vmap(lambda key: sequences.pmj02(4**levels, key).table)(KEYS[:count]))
    orders = [orders_of_quadrants(table, levels) for table in tables]
    assert set(orders) == set(product(((0, 1), (1, 0)), repeat=levels))


def nearest(place, points):
    """Return the squared distance of a place to the nearest of some points on the torus."""
    difference = np.abs(points.astype(np.float64) - place) / 2.0**32
    return (np.minimum(difference, 1 - difference) ** 2).sum(axis=1).min()


@pytest.mark.slow
@pytest.mark.parametrize("n", [40, 700])
def test_each_point_is_the_best_of_its_candidates(n):
    """All earlier points are looked at, in float64."""
    sequence, key, candidates = sequences.sobol(3), jax.random.key(4), 7
    drawn = np.asarray(sequences.net_by_net(sequence, n, key, candidates).table)
    plain = np.asarray(sequences.net_by_net(sequence, n, key).table)
    assert np.array_equal(drawn[:, 2], plain[:, 2]) and np.array_equal(drawn[0], plain[0])
    seeds = jax.random.bits(key, (3, 2), jnp.uint32)
    seeds = hash_word(seeds[:2, None] + (first(candidates) * np.uint32(0x9E3779B9))[None, :, None])
    random = np.asarray(random_word(jnp.asarray(first(n))[:, None, None], seeds[None]))
    steps = np.asarray(to_earlier(sequence.matrices))
    for i in range(1, n):
        k = i.bit_length() - 1
        unit = np.uint32(2 ** (31 - k))
        earlier = np.array([drawn[i ^ steps[j, k], j] for j in range(2)])
        start = (earlier ^ unit) & ~(unit - np.uint32(1))
        places = start[:, None] | (random[i] & (unit - np.uint32(1)))
        distances = [nearest(place, drawn[:i, :2]) for place in places.T]
        assert nearest(drawn[i, :2], drawn[:i, :2]) >= max(distances) * (1 - 1e-6)
        assert drawn[i, :2].tolist() in places.T.tolist()
    for m in range(1, n.bit_length()):
        assert is_net(drawn[: 2**m], m)


@pytest.mark.slow
@pytest.mark.parametrize("n", [16, 64])
def test_candidates_keep_points_apart(n):
    """On average. Later points are bound to too small a square."""

    def distances(candidates):
        draw = jax.jit(jax.vmap(lambda key: sequences.pmj02(n, key, candidates).table))
        return [nearest_pair(table) for table in np.asarray(draw(KEYS[:300]))]

    plain, best = distances(1), distances(50)
    error = np.hypot(np.std(plain), np.std(best)) / np.sqrt(300)
    assert np.mean(best) - np.mean(plain) > 5 * error


def nearest_pair(points):
    return min(nearest(point, np.delete(points, i, axis=0)) ** 0.5 for i, point in enumerate(points))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: sequences.net_by_net(sequences.sobol(1000), 2**20, 0), ValueError, "n must be at most 2"),
        (
            lambda: sequences.net_by_net(sequences.van_der_corput(2003), 2**22, 0),
            ValueError,
            "n must be at most 4012009 in base 2003, got 4194304",
        ),
        (lambda: sequences.net_by_net(sequences.sobol(1), 4, 0, 2), ValueError, "at least 2 dimensions"),
        (lambda: sequences.net_by_net(sequences.halton(2), 4, 0, 2), ValueError, "candidates must be 1"),
        (
            lambda: jax.jit(lambda s: sequences.net_by_net(s, 4, 0).table)(sequences.faure(3)),
            ValueError,
            "sequence must be known before tracing",
        ),
    ],
)
def test_errors_name_the_argument(call, error, message):
    with pytest.raises(error, match=message):
        call()
