"""Scrambled digits in base b: nested, uniform, inside their intervals, down to the zeros behind."""

import math
from fractions import Fraction
from functools import cache, partial
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2, norm
from tables import compositions, first, slow, some

from qmcjax import sequences
from qmcjax.core import digits
from qmcjax.sequences._halton.halton import RadicalInverses
from qmcjax.sequences._scrambling.owen_exact import drawn_together

SCRAMBLINGS = {
    "owen": sequences.owen,
    "owen_exact": sequences.owen_exact,
    "digit_scramble": sequences.digit_scramble,
}
scramblings = some("scramble", SCRAMBLINGS, "owen")
PLAIN = {
    "halton": sequences.halton(2),
    "halton, faure": sequences.halton(3, "faure"),
    "halton, zaremba": sequences.halton(4, "zaremba"),
    "faure(3)": sequences.faure(3),
    "faure(5)": sequences.faure(4, 5),
    "faure(7)": sequences.faure(2, 7, modified=1),
}
THREE = RadicalInverses((3, 3, 3))


@partial(jax.jit, static_argnames="dtype")
def drawn(seq, index, dtype):
    return seq(index, dtype=dtype)


def points(seq, index, dtype=jnp.float64):
    """Return some points. Indices are padded: few programs make all points of a sequence."""
    index = np.asarray(index, np.uint32)
    padded = np.zeros(max(512, 1 << (index.size - 1).bit_length()), np.uint32)
    padded[: index.size] = index.ravel()
    with jax.enable_x64(True):
        found = np.asarray(drawn(seq, jnp.asarray(padded), dtype))[: index.size]
    return found.reshape(*index.shape, seq.dims)


def cells(coordinates, base, count):
    """Return the first digits of coordinates as integers, exactly."""
    ratios = (x.as_integer_ratio() for x in coordinates.ravel().tolist())
    return np.array([n * base**count // d for n, d in ratios]).reshape(coordinates.shape)


def test_cells_are_exact():
    assert cells(np.array([2 / 3, 0.5, np.nextafter(0.5, 0)]), 2, 1).tolist() == [1, 1, 0]
    assert cells(np.array([float(np.float32(2 / 3)), 1 / 3]), 3, 1).tolist() == [2, 0]  # as these round


def ends(base):
    """Return the extreme and some other numerators of all digits of an index, and their tails."""
    rng, total = np.random.default_rng(base), base ** digits.digit_count(base)
    numerators = [0, 1, total - 1, total - 2, total // 2, total // 3, *map(int, rng.integers(0, total, 30))]
    kept = next(k for k in range(30) if base ** (k + 1) >= 2**24)
    lower = total // base**kept
    numerators += [lower * i + d for i in map(int, rng.integers(1, base**kept, 30)) for d in (-1, 0, 1)]
    tails = [0, 2**32 - 1, 2**31, 12345] * (len(numerators) // 4 + 1)
    return numerators, tails[: len(numerators)], kept


@pytest.mark.parametrize("base", [2, 3, 5, 6, 31, 89, 91, 4096, 4099, 65535])
def test_fractions_stay_in_their_elementary_intervals(base):
    """Float64: of all digits. Float32: of as many as make longer intervals than 2**-24; else rounded down."""
    numerators, tails, kept = ends(base)
    count = digits.digit_count(base)
    leading, last = (
        jnp.asarray(np.array(part, np.uint32))
        for part in zip(*(divmod(n, base) for n in numerators), strict=True)
    )
    tail = jnp.asarray(np.array(tails, np.uint32))
    double = np.asarray(digits.cell_fraction(leading, last, tail, base, jnp.float64)).tolist()
    single = np.asarray(digits.cell_fraction(leading, last, tail, base, jnp.float32)).tolist()
    for n, t, x, y in zip(numerators, tails, double, single, strict=True):
        assert Fraction(n, base**count) < Fraction(x) < Fraction(n + 1, base**count)
        exact = (n + Fraction(t, 2**32)) / base**count
        assert abs(Fraction(x) - exact) <= Fraction(1, 2**52) + Fraction(1, 2**54)
        assert 0 <= y < 1
        grid = Fraction(int(x * 2**24), 2**24)
        lowest = Fraction(n // base ** (count - kept), base**kept)
        assert Fraction(y) == (grid if grid >= lowest else grid + Fraction(1, 2**24))
        assert lowest <= Fraction(y) < lowest + Fraction(1, base**kept)


# What a scrambling is: a tree of permutations of digits.


@scramblings
@pytest.mark.parametrize("bases", [(2, 3), *slow((2, 5, 89), (91, 97), (65536,))], ids=str)
def test_points_go_through_the_permutations_of_a_tree(scramble, bases):
    """A digit's image is the one it has with zeros behind; those of all digits after a prefix differ."""
    seq = scramble(RadicalInverses(bases), 3)
    some = np.random.default_rng(0).integers(0, 2**32, 12, dtype=np.uint32).tolist()
    for j, base in enumerate(bases):
        count = digits.digit_count(base)
        paths = points(seq, [[i % base**k for k in range(1, count + 1)] for i in some])[..., j]
        paths = cells(paths, base, count)
        for k in range(1, count + 1):
            unit = base ** (count - k)
            assert np.array_equal(paths[:, k - 1] // unit, paths[:, -1] // unit)
        for prefix, k in [(0, 0), (1, 1), (base - 1, 1), (some[0] % base ** (count - 2), count - 2)]:
            children = points(seq, [prefix + d * base**k for d in range(min(base, 100))])[:, j]
            children = cells(children, base, k + 1)
            assert len(set((children // base).tolist())) == 1
            assert len(set(children.tolist())) == len(children)


@scramblings
@pytest.mark.parametrize("plain", ["faure(3)", *slow("halton, faure", "faure(5)")])
def test_a_coordinate_is_scrambled_as_the_number_it_is(scramble, plain):
    """The same as the radical inverse with these digits, of which all is known above, to the last bit."""
    seq = PLAIN[plain]
    index = np.random.default_rng(4).integers(0, 3**13, 300, dtype=np.uint32)
    unscrambled, found = points(seq, index), points(scramble(seq, 3), index)
    reference = scramble(RadicalInverses(seq.bases), 3)
    for j, base in enumerate(seq.bases):
        count = digits.digit_count(base)
        numbers = np.rint(unscrambled[:, j] * float(base**count)).astype(np.int64)
        mirror = sum(numbers // base ** (count - 1 - k) % base * base**k for k in range(count))
        assert mirror.max() < 2**32
        assert np.array_equal(points(reference, mirror)[:, j], found[:, j])


@scramblings
@pytest.mark.parametrize("plain", ["faure(3)", *slow("faure(5)", "faure(7)")])
def test_faure_sequences_remain_nets(scramble, plain):
    """(0,m,s)-nets: the first and the last block, in float64 and, as they are, in float32."""
    seq = scramble(PLAIN[plain], 3)
    base = seq.sequence.base
    m = {3: 5, 5: 4, 7: 3}[base]
    for start in (0, (2**32 // base**m - 1) * base**m):
        for dtype in (jnp.float64, jnp.float32):
            net = points(seq, first(base**m) + np.uint32(start), dtype)
            prefixes = [[cells(column, base, d) for d in range(m + 1)] for column in net.T]
            for split in compositions(m, seq.dims):
                boxes = [of_dim[d] for of_dim, d in zip(prefixes, split, strict=True)]
                assert len(set(zip(*boxes, strict=True))) == base**m


@scramblings
@pytest.mark.parametrize("plain", ["halton", *slow("halton, zaremba")])
def test_every_box_of_a_halton_period_holds_one_point(scramble, plain):
    """Of 2**3 3**2 consecutive points, one lies in each box 1/8 x 1/9; so for other shapes and bases."""
    seq = scramble(PLAIN[plain], 3)
    bases = seq.sequence.bases
    index = np.stack([first(600) + np.uint32(start) for start in (0, 98765, 2**32 - 600)])
    shapes = [
        (3, 2, 1, 0),
        (0, 1, 1, 1),
        (4, 0, 1, 0),
        (1, 1, 0, 1),
        (9, 0, 0, 0),
        (0, 5, 0, 0),
        (2, 4, 0, 0),
    ]
    for dtype in (jnp.float64, jnp.float32):
        for block in points(seq, index, dtype):
            for shape in {shape[: seq.dims] for shape in shapes}:
                period = np.prod([b**k for b, k in zip(bases, shape, strict=True)])
                ways = zip(block[:period].T, bases, shape, strict=True)
                boxes = [cells(column, b, k).tolist() for column, b, k in ways]
                assert len(set(zip(*boxes, strict=True))) == period


def test_the_count_notices_what_is_no_net():
    net = points(sequences.owen_exact(PLAIN["faure(3)"], 3), first(27) + np.uint32(5))
    assert len(set(zip(*(cells(column, 3, 1).tolist() for column in net.T), strict=True))) < 27


KEYS = jax.random.split(jax.random.key(5), 128)
# Children of the root, of its three children, and of deep nodes: prefix, number of its digits.
NODES = [(0, 0), (0, 1), (1, 1), (2, 1), (0, 8), (1 + 3**9, 16), (2 + 3**9, 16), (5, 19)]
CHILDREN = np.array([p + d * 3**k for p, k in NODES for d in range(3)], np.uint32)


@cache
def over_keys(scramble):
    """Return the points of 0, 1, 2 after each node, and the digits there, (2 coordinates, keys, nodes, 3)."""
    index = jnp.asarray(CHILDREN)
    with jax.enable_x64(True):
        drawn = jax.jit(jax.vmap(lambda key: scramble(THREE, key)))(KEYS)
        found = np.asarray(jax.jit(jax.vmap(lambda seq: seq(index, (0, 1), jnp.float64)))(drawn))
    for key in (0, 127):
        assert np.array_equal(found[key], points(scramble(THREE, KEYS[key]), CHILDREN)[:, :2])
    found = np.moveaxis(found, 2, 0).reshape(2, len(KEYS), len(NODES), 3)
    digit = [cells(found[:, :, i].ravel(), 3, k + 1).reshape(2, -1, 3) % 3 for i, (_, k) in enumerate(NODES)]
    return np.stack(digit, axis=2), found


ALL = list(permutations(range(3)))


def numbered(digit):
    """Return the number of each permutation (..., 3)."""
    return np.argmax(np.all(digit[..., None, :] == np.array(ALL), axis=-1), axis=-1)


def plausible(counted, count):
    """Tell whether chi-squared is within 5 sigma of what equal frequencies give: upper and lower tail."""
    expected = len(counted) / count
    statistic = ((np.bincount(counted, minlength=count) - expected) ** 2 / expected).sum()
    return min(chi2.sf(statistic, count - 1), chi2.cdf(statistic, count - 1)) > norm.sf(5)


@pytest.mark.slow
@scramblings
def test_all_permutations_are_equally_likely_at_every_node(scramble):
    digit, _ = over_keys(scramble)
    assert np.array_equal(np.sort(digit, axis=-1), np.broadcast_to([0, 1, 2], digit.shape))
    number = numbered(digit)
    for j in (0, 1):
        for node in range(len(NODES)):
            assert plausible(number[j, :, node], 6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["owen", "owen_exact"])
def test_all_scramblings_of_three_digits_come(name):
    """The 128 of them in base 2, equally often, first and behind fourteen digits."""
    depths, eight = np.array([0, 14], np.uint32)[:, None], first(8)
    nodes = jnp.asarray(np.array([0, 1 + 2**13], np.uint32)[:, None] + (eight << depths))
    with jax.enable_x64(True):
        drawn = jax.vmap(lambda key: SCRAMBLINGS[name](RadicalInverses((2,)), key))
        draw = jax.jit(lambda keys: jax.vmap(lambda seq: seq(nodes, (0,), jnp.float64))(drawn(keys)))
        found = np.concatenate([draw(keys)[..., 0] for keys in jax.random.split(jax.random.key(6), (8, 256))])
    for node, depth in enumerate((0, 14)):
        digit = cells(found[:, node], 2, depth + 3) % 8
        # Images of 0 in the first digit, of 0 and 1 before it in the second, of 00, 10, 01, 11 in the third.
        flips = [digit[:, 0] >> 2, *(digit[:, :2].T >> 1 & 1), *(digit[:, :4].T & 1)]
        number = sum(flip << k for k, flip in enumerate(flips))
        assert np.bincount(number, minlength=128).min() > 0
        assert plausible(number, 128)


@scramblings
def test_coordinates_are_scrambled_independently(scramble):
    number = numbered(over_keys(scramble)[0])
    for node in range(len(NODES)):
        assert plausible(number[0, :, node] * 6 + number[1, :, node], 36)


@pytest.mark.parametrize("name", ["owen", *slow("owen_exact")])
def test_how_two_points_differ_is_independent_between_coordinates(name):
    digit, _ = over_keys(SCRAMBLINGS[name])
    for a in range(len(NODES)):
        for b in range(a):
            difference = (digit[:, :, a, 0] - digit[:, :, b, 0]) % 3
            assert plausible(difference[0] * 3 + difference[1], 9)


@pytest.mark.slow
def test_permutations_of_different_nodes():
    """Independent if exact; hashed, some differ by shifts only; the same at a level in digit scrambling."""
    pairs = [(a, b) for a in range(len(NODES)) for b in range(a)]
    siblings = [(a, b) for a, b in pairs if NODES[a][1] == NODES[b][1]]
    number = {name: numbered(over_keys(scramble)[0])[0] for name, scramble in SCRAMBLINGS.items()}
    for a, b in pairs:
        exact = number["owen_exact"]
        assert plausible(exact[:, a] * 6 + exact[:, b], 36)
    for a, b in siblings:
        fixed = number["digit_scramble"]
        assert np.array_equal(fixed[:, a], fixed[:, b])
    # The limit of the hash: even and odd permutations after prefixes that end another span do not mix.
    even = np.array([np.linalg.det(np.eye(3)[list(p)]) for p in ALL])
    hashed = even[number["owen"]]
    assert np.array_equal(hashed[:, 5], hashed[:, 6])


@pytest.mark.parametrize("name", ["owen", *slow("owen_exact")])
def test_any_two_points_are_as_after_nested_uniform_scrambling(name):
    """Digits behind those that two points share: distinct pairs where they part, all pairs later."""
    digit, _ = over_keys(SCRAMBLINGS[name])
    for node in range(len(NODES)):
        pair = digit[0, :, node, 0] * 3 + digit[0, :, node, 2]
        assert not plausible(pair, 9)
        assert plausible(np.searchsorted([1, 2, 3, 5, 6, 7], pair), 6)
    for a in range(len(NODES)):
        for b in range(a):
            for d in range(3):
                assert plausible(digit[0, :, a, 0] * 3 + digit[0, :, b, d], 9)


@scramblings
@pytest.mark.parametrize("count", [21, *slow(24)])
def test_zeros_behind_the_digits_are_scrambled(scramble, count):
    """What follows is uniform; for Owen's, another one for each point. Tables of the hash hold 24 digits."""
    tails = over_keys(scramble)[1] * 3.0**count % 1
    # Two points that part at the last digit of an index.
    last = points(scramble(THREE, KEYS[0]), [5, 5 + 3**20]) * 3.0**count % 1
    assert np.all(np.abs(last[0] - last[1]) < 0.001) == (scramble is sequences.digit_scramble)
    assert np.any(np.abs(last[0] - last[1]) < 0.001) == (scramble is sequences.digit_scramble)
    for j in (0, 1):
        for node in (0, -1):
            one, other = tails[j, :, node, 0], tails[j, :, node, 1]
            assert plausible((one * 16).astype(int), 16)
            apart = np.abs((one - other + 0.5) % 1 - 0.5)
            if scramble is sequences.digit_scramble:
                assert apart.max() < 0.001
            else:
                assert plausible((apart * 16).astype(int), 8)
    assert plausible((tails[0, :, 0, 0] * 4).astype(int) * 4 + (tails[1, :, 0, 0] * 4).astype(int), 16)


@pytest.mark.parametrize("depth", [7, 16])
def test_nodes_of_one_key_look_independent(depth):
    """Permutations at a level: equally frequent, whatever the other coordinate and the digit before."""
    seq = sequences.owen_exact(THREE, 3)
    prefix = np.random.default_rng(1).choice(3**7, 680, replace=False) * 3 ** (depth - 7)
    found = points(seq, prefix[:, None] + np.arange(3) * 3**depth)
    digit = [cells(found[..., j].ravel(), 3, depth + 1).reshape(-1, 3) % 3 for j in (0, 1)]
    number, other = map(numbered, digit)
    assert plausible(number, 6)
    assert plausible(number * 6 + other, 36)
    assert plausible(number * 3 + cells(found[:, 0, 0], 3, depth) % 3, 18)


@pytest.mark.parametrize(
    ("base", "depth"),
    [(5, 4), *[pytest.param(*b, marks=pytest.mark.slow) for b in [(2, 11), (8, 4), (13, 3), (31, 2)]]],
)
def test_exact_permutations_in_other_bases(base, depth):
    """Over the nodes of a level: any digit goes anywhere, any two by any difference, equally often."""
    seq = sequences.owen_exact(RadicalInverses((base,)), 2)
    index = np.arange(base**depth)[:, None] + np.arange(base) * base**depth
    digit = cells(points(seq, index.astype(np.uint32)).ravel(), base, depth + 1).reshape(-1, base) % base
    assert np.array_equal(np.sort(digit, axis=1), np.broadcast_to(np.arange(base), digit.shape))
    for d in range(base):
        assert plausible(digit[:, d], base)
        assert base == 2 or plausible((digit[:, d] - digit[:, d - 1]) % base - 1, base - 1)


@pytest.mark.slow
@scramblings
def test_coordinates_together_equal_single_ones(scramble):
    seq = scramble(RadicalInverses((97, 101, 103, 107, 109, 113, 127, 131, 257)), 1)
    index = np.random.default_rng(0).integers(0, 2**32, 64, np.uint32)
    for dtype in (jnp.float32, jnp.float64):
        together = points(seq, index, dtype)
        for j in (0, 3, 8):
            alone = jax.jit(lambda s, i, j=j, dtype=dtype: s(i, (j,), dtype))(seq, index)
            assert np.array_equal(alone[:, 0], together[:, j])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "plain", "sizes", "slope"),
    [
        ("owen_exact", sequences.van_der_corput(3), 3 ** np.arange(2, 8), -3),
        ("owen_exact", sequences.faure(2, 3), 3 ** np.arange(2, 8), -2.9),
        ("owen", sequences.faure(2, 3), 3 ** np.arange(2, 8), -2.9),
        ("owen_exact", sequences.halton(2), 6 ** np.arange(1, 5), -2.45),
        ("owen", sequences.halton(2), 6 ** np.arange(1, 5), -2.45),
        ("owen", sequences.faure(2, 5), 5 ** np.arange(1, 5), -2.9),
    ],
)
def test_the_variance_of_a_smooth_mean(name, plain, sizes, slope):
    """Over blocks of b**m points n**-3 but for logarithms, as it must; over 6**m points of Halton's less."""
    keys = jax.random.split(jax.random.key(7), 200)
    scramblings = jax.vmap(lambda key: SCRAMBLINGS[name](plain, key))(keys)
    index = jnp.asarray(first(max(sizes)))
    with jax.enable_x64(True):
        x = np.asarray(jax.jit(jax.vmap(lambda seq: seq(index, dtype=jnp.float64)))(scramblings))
    means = [np.exp(x[:, :n]).prod(axis=2).mean(axis=1) for n in sizes]
    variances = [np.mean((mean - (np.e - 1) ** plain.dims) ** 2) for mean in means]
    found = np.polyfit(np.log(sizes), np.log(variances), 1)[0]
    assert found == pytest.approx(slope, abs=0.2)


@jax.jit
def points_of_many(scramblings, index):
    return jax.vmap(lambda seq: seq(index, dtype=jnp.float64))(scramblings)


def joint_digits(scramble, base, index, places, count=6000):
    """Return the digits of points at some places (point, digit) over many keys: int (keys, places)."""
    keys = jax.random.split(jax.random.key(17), count)
    scramblings = jax.vmap(lambda key: scramble(sequences.van_der_corput(base), key))(keys)
    index = jnp.asarray(np.array(index, np.uint32))
    with jax.enable_x64(True):
        made = points_of_many(scramblings, index)
    x = np.asarray(made)[..., 0]
    return np.stack([np.floor(x[:, point] * base ** (digit + 1)) % base for point, digit in places], axis=-1)


def excess(outcomes, number):
    """Return chi-square of outcomes, of which ``number`` are equally likely, less its mean, in sigmas."""
    counts = np.unique(outcomes, axis=0, return_counts=True)[1]
    assert len(counts) <= number
    expected = len(outcomes) / number
    chi_square = ((counts - expected) ** 2).sum() / expected + (number - len(counts)) * expected
    return (chi_square - (number - 1)) / np.sqrt(2 * (number - 1))


@pytest.mark.parametrize("name", [*slow("owen"), "owen_exact"])
@pytest.mark.parametrize("base", [5, *slow(11)])
def test_joint_digits_of_pairs_are_uniform(name, base):
    """Where two points part, all pairs of different digits are equally likely, whatever comes before."""
    index = [0, 1, base + 1, base + 2]
    digit = joint_digits(SCRAMBLINGS[name], base, index, [(0, 0), (1, 0), (1, 1), (2, 1), (3, 1)]).T
    assert excess(digit[[0, 1]].T, base * (base - 1)) < 5
    # Points 1 and base + 1 part at the second digit, 1 and base + 2 at the first.
    assert excess(digit[[1, 2, 3]].T, base**2 * (base - 1)) < 5
    assert excess(digit[[2, 4]].T, base**2) < 5


@pytest.mark.parametrize("base", [2, 3, *slow(5)])
def test_joint_digits_of_exactly_scrambled_triples_are_uniform(base):
    """Three points of which two share the first digit, and three that part at once."""
    scramble = sequences.owen_exact
    shared = joint_digits(scramble, base, [0, base, 1], [(0, 0), (2, 0), (0, 1), (1, 1), (2, 1)])
    assert excess(shared, (base * (base - 1)) ** 2 * base) < 5
    if base > 2:
        parted = joint_digits(scramble, base, [0, 1, 2], [(0, 0), (1, 0), (2, 0)])
        assert excess(parted, base * (base - 1) * (base - 2)) < 5


@pytest.mark.parametrize("scramble", SCRAMBLINGS.values(), ids=SCRAMBLINGS)
def test_what_has_no_digits_is_refused(scramble):
    for seq in (sequences.rotate(PLAIN["halton"], np.zeros(2)), np.zeros(3), None):
        with pytest.raises(TypeError, match=r"sequence must be a sequence with digits.* got"):
            scramble(seq, 0)
    with pytest.raises(TypeError, match=r"key must be one jax.random.key.* got 'seed'"):
        scramble(PLAIN["halton"], "seed")
    with pytest.raises(TypeError, match=r"sequence must be a sequence with digits.* got owen_exact"):
        sequences.owen(sequences.owen_exact(PLAIN["halton"], 1), 1)


def test_swaps_drawn_together_are_nearly_uniform():
    """One word has at most 2**13 outcomes, or one swap; with another swap it would have more."""
    for base in range(3, 2**13, 7):
        count = drawn_together(base)
        outcomes = [math.prod(range(base - k + 1, base + 1)) for k in (count, count + 1)]
        assert count == 1 or outcomes[0] <= 2**13
        assert count == base - 1 or outcomes[1] > 2**13
