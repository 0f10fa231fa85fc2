"""Scramblings in base 2 and in base b: which theorems each one keeps, over keys and over the nodes of a key.

The tested coordinates are radical inverses, so an index is the path of a point in the tree of digits. A node
is a prefix and the number of its digits. All bounds are 5 standard deviations, the keys are always the same.
"""

import math
from collections.abc import Callable
from functools import cache
from itertools import permutations, product
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.distance import pdist, squareform
from scipy.stats import chi2, norm
from tables import few, first, slow, slow_cases

from analysis import t_value
from qmcjax import sequences
from qmcjax.core.checks import prng_key
from qmcjax.sequences._digital.halton import RadicalInverses
from qmcjax.sequences._scrambling.owen import with_tables


class Scrambling(NamedTuple):
    scramble: Callable
    """From a sequence and a key to a sequence."""
    base: int
    breaks: str = ""
    """The theorems that it does not keep, of "nodes", "pairs" and "trees"."""
    digits: int = 18
    """How many digits of an index are looked at."""
    keys: int = 8192


def art_owen(seq, key):
    """Return the scrambling with its small tables: there are thousands."""
    return with_tables(seq, prng_key("key", key), 4)


def net_by_net(seq, key):
    return sequences.net_by_net(seq, 3**5, key)


SCRAMBLINGS = {
    "xor": Scrambling(sequences.digital_shift, 2, "nodes pairs trees", 30),
    "matousek": Scrambling(sequences.linear_matrix_scramble, 2, "trees", 30),
    "owen": Scrambling(sequences.owen, 2, digits=30),
    "owen_exact": Scrambling(sequences.owen_exact, 2, digits=30),
    "art_owen": Scrambling(art_owen, 2, digits=30),
    "net_by_net": Scrambling(net_by_net, 2, digits=7),
    "digit_scramble, 3": Scrambling(sequences.digit_scramble, 3, "nodes pairs trees", keys=1024),
    # After prefixes that end another span, permutations differ by shifts only.
    "owen, 3": Scrambling(sequences.owen, 3, "nodes", keys=256),
    "owen_exact, 3": Scrambling(sequences.owen_exact, 3),
    "net_by_net, 3": Scrambling(net_by_net, 3, digits=5),
    "owen, 5": Scrambling(sequences.owen, 5, digits=12, keys=256),
    "owen_exact, 5": Scrambling(sequences.owen_exact, 5, digits=12),
    "net_by_net, 6": Scrambling(net_by_net, 6, digits=3),
}
each_scrambling = pytest.mark.parametrize(
    "name", few(SCRAMBLINGS, "matousek", "owen", "owen_exact", "digit_scramble, 3", "owen, 3")
)
LEVELS = {2: 3, 3: 2, 5: 1, 6: 1}
"""Of trees of which all nested permutations are counted: 2**7, 6**4, 120 and 720."""


def radical_inverses(base):
    """Return three coordinates that are all the radical inverse of the index."""
    if base > 2:
        return RadicalInverses((base,) * 3)
    return sequences.digital(np.tile(np.uint32(1) << np.arange(31, -1, -1, dtype=np.uint32), (3, 1)))


def prefixes(name):
    """Return nodes: those of the first levels, and of later ones such that differ in a digit."""
    _, base, _, digits, _ = SCRAMBLINGS[name]
    top = [(prefix, depth) for depth in range(LEVELS[base] + 1) for prefix in range(base**depth)]
    deep = [(0x12345678 % base**depth, depth) for depth in range(8, digits, 4)]
    others = [((prefix + base ** (depth - 7)) % base**depth, depth) for prefix, depth in deep]
    return [*top, *deep, *others] if base < 5 else top[:6]


def subtrees(name):
    """Return nodes of which whole subtrees are looked at."""
    _, base, _, digits, _ = SCRAMBLINGS[name]
    return [(0, 0)] if digits < 12 else [(0, 0), (1 + base**8, 9)]


@cache
def images(name):
    """Return the paths of points and their images for all keys, float64 (keys, paths, 3)."""
    scramble, base, *_ = SCRAMBLINGS[name]
    paths = {prefix + d * base**depth for prefix, depth in prefixes(name) for d in range(base)}
    paths |= {p + k * base**depth for p, depth in subtrees(name) for k in range(base ** LEVELS[base])}
    paths = sorted(paths)
    index = jnp.asarray(np.array(paths, np.uint32))

    def of_key(key):
        return scramble(radical_inverses(base), key)(index, dtype=jnp.float64)

    with jax.enable_x64(True):
        keys = jax.random.split(jax.random.key(5), SCRAMBLINGS[name].keys)
        return paths, np.asarray(jax.jit(lambda keys: jax.lax.map(of_key, keys, batch_size=512))(keys))


def leading(name, index, depth, dim=0):
    """Return the first digits of the images of paths as integers (keys, paths)."""
    paths, points = images(name)
    places = np.searchsorted(paths, index)
    return np.floor(points[:, places, dim] * float(SCRAMBLINGS[name].base) ** depth).astype(np.int64)


def cells(coordinates, base, count):
    """Return the first digits of coordinates as integers, exactly."""
    ratios = (x.as_integer_ratio() for x in coordinates.ravel().tolist())
    return np.array([n * base**count // d for n, d in ratios]).reshape(coordinates.shape)


def is_uniform(outcomes, count):
    """Tell whether chi-squared is within 5 sigma of what equal frequencies give: the lower tail of many."""
    expected = outcomes.size / count
    statistic = ((np.bincount(outcomes.ravel(), minlength=count) - expected) ** 2 / expected).sum()
    likely = chi2.sf(statistic, count - 1), chi2.cdf(statistic, count - 1) if count > 8 else 1
    return min(likely) > norm.sf(5)


def numbered(digits, base):
    """Return the number of each permutation (..., base)."""
    codes = [sum(d * base**k for k, d in enumerate(p)) for p in permutations(range(base))]
    order = np.argsort(codes)
    found = (digits * base ** np.arange(base)).sum(axis=-1)
    places = np.searchsorted(codes, found, sorter=order)
    assert np.array_equal(np.array(codes)[order[places]], found)  # They are permutations.
    return order[places]


def permutations_at(name, node, dim=0):
    """Return the number of the permutation at a node for all keys."""
    prefix, depth = node
    base = SCRAMBLINGS[name].base
    children = [prefix + d * base**depth for d in range(base)]
    return numbered(leading(name, children, depth + 1, dim) % base, base)


@pytest.mark.parametrize("name", few(SCRAMBLINGS, "owen", "owen_exact", "net_by_net, 3", "owen, 3"))
def test_images_share_exactly_the_digits_that_points_share(name):
    """Nestedness at every depth: digits after a prefix are permuted, by the prefix alone."""
    scramble, base, *_ = SCRAMBLINGS[name]
    count = next(k for k in range(33) if base ** (k + 1) > (3**5 if "net" in name else 2**32))
    rng, unit = np.random.default_rng(0), base ** np.arange(count)[:, None]
    one, other = rng.integers(0, base**count, (2, count, 12))
    # In row k they share k digits.
    digit = (one // unit + rng.integers(1, base, one.shape)) % base
    other = one % unit + digit * unit + other // (unit * base) * (unit * base)
    seq = scramble(radical_inverses(base), 1)
    points = np.asarray(seq(np.stack([one, other]).astype(np.uint32), dtype=jnp.float64))
    for dim in (0, 2):
        first_image, other_image = cells(points[..., dim], base, count)
        for shared in range(1, count + 1):
            rest = base ** (count - shared)
            equal = first_image // rest == other_image // rest
            assert np.all(equal == (np.arange(count) >= shared)[:, None])


@each_scrambling
def test_points_are_uniform_and_coordinates_independent(name):
    """Some digits of one point together, of two coordinates."""
    base = SCRAMBLINGS[name].base
    together = {2: 4, 3: 2}.get(base, 1)
    size = base**together
    for depth in {0, 1, 8, SCRAMBLINGS[name].digits - together} if "net" not in name else (0, 1, 8):
        x, y = (leading(name, [0], depth + together, dim) % size for dim in (0, 2))
        assert is_uniform(x * size + y, size**2)


@each_scrambling
def test_permutations_of_nodes(name):
    """All are equally likely; of any two nodes, also of two coordinates, they are independent."""
    base, keys, breaks = SCRAMBLINGS[name].base, SCRAMBLINGS[name].keys, SCRAMBLINGS[name].breaks
    count, features, of_node = math.factorial(base), [], []
    for dim, (prefix, depth) in product((0, 1), prefixes(name)):
        number = permutations_at(name, (prefix, depth), dim)
        assert is_uniform(number, count)
        if base > 3:  # Where a digit goes: there are many permutations.
            number, values = leading(name, [prefix], depth + 1, dim)[:, 0] % base, base
        else:
            values = count
        features += [number == value for value in range(values - 1)]
        of_node += [(dim, prefix, depth)] * (values - 1)
    different = np.array([[one != other for other in of_node] for one in of_node])
    correlation = 1 - squareform(pdist(np.array(features), "correlation"))
    largest = np.abs(correlation[different]).max() * np.sqrt(keys)
    assert (largest < 5.5) == ("nodes" not in breaks)
    if "pairs" in breaks:  # The same permutation at all nodes of a level.
        assert largest == pytest.approx(np.sqrt(keys))


@each_scrambling
def test_two_points_that_part(name):
    """Different digits where they part, of all pairs; then they are independent, as for random points."""
    base = SCRAMBLINGS[name].base
    later = {2: 2, 3: 2}.get(base, 1) if LEVELS[base] > 1 else 1
    for prefix, depth in subtrees(name):
        one, other = leading(name, [prefix, prefix + base**depth], depth + 1 + later).T
        parting = base * (one // base**later % base) + other // base**later % base
        which = np.searchsorted([i for i in range(base**2) if i % (base + 1)], parting)
        behind = base**later
        outcome = (which * behind + one % behind) * behind + other % behind
        uniform = is_uniform(outcome, base * (base - 1) * behind**2)
        assert uniform == ("pairs" not in SCRAMBLINGS[name].breaks)


@each_scrambling
def test_all_nested_permutations_are_equally_likely(name):
    """Of some levels, after no digit and after several."""
    base = SCRAMBLINGS[name].base
    count = math.factorial(base)
    for prefix, depth in subtrees(name):
        number = 0
        for level in range(LEVELS[base]):
            for k in range(base**level):
                node = prefix + k * base**depth, depth + level
                number = number * count + permutations_at(name, node)
        total = count ** sum(base**level for level in range(LEVELS[base]))
        assert is_uniform(number, total) == ("trees" not in SCRAMBLINGS[name].breaks)


@pytest.mark.parametrize(("base", "depth"), [(2, 16), (3, 7), (5, 4), *slow_cases((2, 8), (2, 14), (3, 16))])
def test_nodes_of_one_key_look_independent(base, depth):
    """Equally frequent at a level, whatever the other coordinate, the digits before, and other prefixes."""
    seq = sequences.owen_exact(radical_inverses(base), 3)
    shared = min(depth, {2: 16, 3: 7, 5: 4}[base])
    prefix = np.random.default_rng(1).permutation(base**shared)[: 2**12] * base ** (depth - shared)
    index = prefix[:, None] + np.arange(base) * base**depth
    points = np.asarray(seq(index.astype(np.uint32), dtype=jnp.float64))
    image = np.floor(points * float(base) ** (depth + 1)).astype(np.int64)
    number, other = (numbered(image[..., dim] % base, base) for dim in (0, 1))
    count = math.factorial(base)
    assert is_uniform(number, count)
    if base < 5:
        assert is_uniform(number * count + other, count**2)
    for distance in range(1, 4):
        assert is_uniform(number * base + image[:, 0, 0] // base**distance % base, count * base)
        assert is_uniform(number * base + prefix // base ** (depth - distance) % base, count * base)
    if depth == shared and len(prefix) == base**depth:
        # A prefix and those that differ in one digit.
        in_order = number[np.argsort(prefix)]
        for digit in range(depth):
            moved = in_order[(np.arange(base**depth) + base**digit) % base**depth]
            assert is_uniform((in_order - moved) % count, count) or base == 2
            same = np.mean(in_order == moved)
            assert abs(same - 1 / count) < 5 * np.sqrt(2 / count / base**depth)


@pytest.mark.parametrize("base", slow(8, 13, 31))
def test_exact_permutations_in_other_bases(base):
    """Over the nodes of a level: any digit goes anywhere, any two by any difference, equally often."""
    depth = {8: 4, 13: 3, 31: 2}[base]
    index = np.arange(base**depth)[:, None] + np.arange(base) * base**depth
    seq = sequences.owen_exact(RadicalInverses((base,)), 2)
    points = np.asarray(seq(index.astype(np.uint32), dtype=jnp.float64))[..., 0]
    digit = cells(points, base, depth + 1) % base
    assert np.array_equal(np.sort(digit, axis=1), np.broadcast_to(np.arange(base), digit.shape))
    for d in range(base):
        assert is_uniform(digit[:, d], base)
        assert is_uniform((digit[:, d] - digit[:, d - 1]) % base - 1, base - 1)


PLAIN = {
    "sobol": (sequences.sobol(2), 2, 2**10),
    "permutation": (sequences.permutation_net(10), 2, 2**10),
    "sobol, 3-D": (sequences.sobol_net_3d(9), 2, 2**9),
    "permutation, 3-D": (sequences.permutation_net_3d(8), 2, 2**8),
    "larcher_pillichshammer": (sequences.larcher_pillichshammer(), 2, 2**8),
    "faure": (sequences.faure(3), 3, 3**5),
    "faure, 5": (sequences.faure(4, 5), 5, 5**3),
    "faure, modified": (sequences.faure(2, 7, modified=1), 7, 7**3),
}


IN_ANY_BASE = sequences.owen, sequences.owen_exact, sequences.digit_scramble
QUICK = "sobol", "permutation", "faure"
IN_BASE_2 = sequences.linear_matrix_scramble, sequences.digital_shift, art_owen


PAIRS = [(scramble, plain) for scramble in IN_ANY_BASE + IN_BASE_2 for plain in PLAIN]
PAIRS = [(scramble, plain) for scramble, plain in PAIRS if PLAIN[plain][1] == 2 or scramble in IN_ANY_BASE]
STAY = {f"{scramble.__name__}-{plain}": (scramble, plain) for scramble, plain in PAIRS}
QUICKLY = [k for k, (scramble, plain) in STAY.items() if plain in QUICK and scramble != art_owen]


@pytest.mark.parametrize("name", few(STAY, *QUICKLY))
def test_t_stays(name):
    """Of the first net and of the last one of an unbounded sequence, in both precisions."""
    scramble, plain = STAY[name]
    seq, base, n = PLAIN[plain]
    starts = (0,) if seq.size else (0, (2**32 // n - 1) * n)
    scrambled = scramble(seq, 11)
    for start in starts:
        for dtype in (jnp.float32, jnp.float64):
            before = np.asarray(seq.points(n, start, jnp.float64))
            if base > 2:  # Fractions are rounded, and may be on the wrong side of a border.
                digits = 6 if base < 7 else 4
                before = (np.floor(before * base**digits + 1e-9) + 0.5) / base**digits
            after = np.asarray(scrambled.points(n, start, dtype), np.float64)
            assert t_value(after, base=base) == t_value(before, base=base)


@pytest.mark.parametrize(
    ("name", "plain", "sizes", "slope"),
    [
        ("owen", sequences.sobol(2), 2 ** np.arange(4, 13), -3),
        *slow_cases(
            ("owen_exact", sequences.sobol(2), 2 ** np.arange(4, 13), -3),
            ("owen_exact", sequences.van_der_corput(3), 3 ** np.arange(2, 8), -3),
            ("owen", sequences.faure(2, 3), 3 ** np.arange(2, 8), -2.9),
            ("owen_exact", sequences.halton(2), 6 ** np.arange(1, 5), -2.45),
            ("owen", sequences.faure(2, 5), 5 ** np.arange(1, 5), -2.9),
        ),
    ],
)
def test_the_variance_of_a_smooth_mean(name, plain, sizes, slope):
    """Over blocks of b**m points n**-3 but for logarithms, as it must; over 6**m points of Halton's less."""
    index = jnp.asarray(first(max(sizes)))

    def points(key):
        return getattr(sequences, name)(plain, key)(index, dtype=jnp.float64)

    with jax.enable_x64(True):
        x = np.asarray(jax.jit(jax.vmap(points))(jax.random.split(jax.random.key(7), 200)))
    means = [np.exp(x[:, :n]).prod(axis=2).mean(axis=1) for n in sizes]
    variances = [np.mean((mean - (np.e - 1) ** plain.dims) ** 2) for mean in means]
    assert np.polyfit(np.log(sizes), np.log(variances), 1)[0] == pytest.approx(slope, abs=0.2)
