"""From pixel to index: Halton over the raster, scrambled nets and sequences, padded replications."""

from fractions import Fraction
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import NETS, Table, few, first, pixels, points_of, reflected, slow, slow_cases, some

import analysis
import qmcjax as qj
from qmcjax import samplers, scenes, sequences
from qmcjax.samplers._full_screen import HaltonFullScreen

pytestmark = pytest.mark.usefixtures("least_optimized")

SIDE = 8


@jax.jit
def inverted(sampler, x, y, sample):
    """Return the indices of samples and their points, by one program."""
    if isinstance(sampler, HaltonFullScreen):
        index = sampler.index(x, y, sample)
    else:
        index = sampler.net.index_in_cell(x, y, sampler.log_side, sample)
    return index, sampler(x, y, sample, (0, 1), jnp.float64), sampler(x, y, sample, (0, 1))


def on_screen(sampler, x, y, sample, side):
    """Put pixel and offset together again: exact, for a side that is a power of two."""
    return (np.stack([x, y], axis=1) + np.asarray(points_of(sampler, x, y, sample))) / side


HALTON = Table(
    {
        "plain": lambda: sequences.halton(3),
        "zaremba": lambda: sequences.halton(2, "zaremba"),
        "faure": lambda: sequences.halton(2, "faure"),
        "faure_lemieux": lambda: sequences.halton(2, "faure_lemieux"),
        "random": lambda: sequences.halton(2, "random", key=1),
        "random, other key": lambda: sequences.halton(2, "random", key=2),
    }
)


@jax.jit
def at_indices(seq, index):
    """Return the first two coordinates of points."""
    return seq(index, (0, 1), jnp.float64)


def numerators(seq, index):
    """Return the points of indices as exact integers over 2**32 and 3**21."""
    points = np.asarray(at_indices(seq, index))
    return np.rint(points * [2.0**32, 3.0**21]).astype(np.int64)


@some("seq", HALTON, "plain", "faure", "random")
@pytest.mark.parametrize("width, height, a, b", [(5, 10, 3, 3), *slow_cases((8, 9, 3, 2))])
def test_halton_over_the_raster_and_back(seq, width, height, a, b):
    """All points of three blocks sorted into pixels: each pixel's have its indices, pixels and offsets."""
    sampler = samplers.full_screen(seq, width, height)
    assert isinstance(sampler, HaltonFullScreen)
    assert sampler.raster == (2**a, 3**b)
    x, y, sample = pixels(2**a, 3**b, 3)
    index, points, _ = map(np.asarray, inverted(sampler, x, y, sample))
    assert np.array_equal(np.sort(index), first(3 * 2**a * 3**b))
    assert np.array_equal(index // (2**a * 3**b), sample)
    exact = numerators(seq, index)
    units = np.array([2 ** (32 - a), 3 ** (21 - b)])
    assert np.array_equal(exact // units, np.stack([x, y], axis=1))
    assert np.array_equal(points, (exact % units) / units)


LARGE = [(8192, 8192, 26), (1920, 1080, 958), (65536, 59049, 1), (16384, 65536, 1), (1, 1, 2**32)]
LARGE = [*((*size, "plain") for size in LARGE), *slow_cases((8192, 8192, 26, "random"))]


@pytest.mark.parametrize("width, height, spp, name", LARGE)
def test_halton_over_large_rasters_against_python_integers(width, height, spp, name):
    """Indices up to the last below 2**32; offsets have full precision, also in float32."""
    sampler = samplers.full_screen(HALTON[name], width, height)
    assert sampler.fits.spp == spp
    a, b = (width - 1).bit_length(), next(b for b in range(12) if 3**b >= height)
    rng = np.random.default_rng(3)
    x, y, sample = (
        np.append(rng.integers(0, n, 60, dtype=np.uint32), np.array([0, n - 1], np.uint32))
        for n in (width, height, spp)
    )
    arguments = tuple(map(jnp.asarray, (x, y, sample)))
    index, double, single = map(np.asarray, inverted(sampler, *arguments))
    if name == "random":  # With a permutation for each of 21 ternary digits, of which 9 are the row.
        exact, units = numerators(HALTON[name], index), np.array([2 ** (32 - a), 3 ** (21 - b)])
        assert np.array_equal(index // (2**a * 3**b), sample)
        assert np.array_equal(exact // units, np.stack([x, y], axis=1))
        assert np.array_equal(double, (exact % units) / units)
        return
    for i, *pixel, s, low, high in zip(index.tolist(), x, y, sample, single, double, strict=True):
        assert i // (2**a * 3**b) == s
        column, within_x = divmod(reflected(i, 2) * 2**a, 1)
        row, within_y = divmod(reflected(i, 3) * 3**b, 1)
        assert (column, row) == tuple(pixel)
        assert high.tolist() == [float(within_x), float(within_y)]
        # Rounded down in base 2, and to nearest, but below 1, in base 3.
        assert low[0] == float(within_x * 2**24 // 1) / 2**24
        assert low[1] == min(np.float32(float(within_y)), np.float32(1 - 2.0**-24))


def test_halton_of_more_dimensions_is_the_sequence():
    seq = HALTON["plain"]
    sampler = samplers.full_screen(seq, 5, 10)
    x, y, sample = pixels(8, 27, 3)
    index, points, _ = map(np.asarray, inverted(sampler, x, y, sample))
    both = np.asarray(points_of(sampler, x, y, sample, (2, 0)))
    assert np.array_equal(both[:, 0], np.asarray(seq.points(index.size, dtype=jnp.float64))[index, 2])
    assert np.array_equal(both[:, 1], points[:, 0])


SCRAMBLED = {
    **{f"plain {name}": net for name, net in NETS.items()},
    "plain 3d": sequences.sobol_net_3d,
    "plain 3d, modified": sequences.larcher_pillichshammer_net_3d,
    "plain sobol": lambda m: sequences.sobol(2),
    "plain larcher_pillichshammer sequence": lambda m: sequences.larcher_pillichshammer(),
    "hammersley": lambda m: sequences.digital_shift(sequences.hammersley_net(m), key=1),
    "larcher_pillichshammer": lambda m: sequences.digit_scramble(sequences.larcher_pillichshammer_net(m), 2),
    "permutation": lambda m: sequences.digital_shift(sequences.permutation_net(m), key=3),
    "optimized": lambda m: sequences.digital_shift(sequences.optimized_net(m), key=4),
    "3d, twice": lambda m: sequences.digital_shift(sequences.digital_shift(sequences.sobol_net_3d(m), 5), 6),
    "jittered": lambda m: sequences.digital_shift(sequences.jittered(2 ** (m // 2), 2, key=7), key=8),
    "sobol": lambda m: sequences.digital_shift(sequences.sobol(2), key=9),
    "art, net": lambda m: sequences.art_owen(sequences.larcher_pillichshammer_net(m), key=11),
    "art, sobol": lambda m: sequences.art_owen(sequences.sobol(4), key=12),
    "matousek": lambda m: sequences.linear_matrix_scramble(sequences.larcher_pillichshammer(), key=10),
}


QUICK = "plain hammersley", "plain optimized", "permutation", "3d, twice", "sobol"
QUICK_SIZES = {(8, 4): QUICK, (2, 32): ["plain permutation", "plain 3d, modified", "art, sobol"]}
"""With an even, and an odd number of digits of an index."""


SIZES = [(8, 4), (8, 1), (8, 2), (1, 2), (1, 8), (2, 1), (2, 32), (32, 1), (32, 2)]


@pytest.mark.parametrize(
    ("side", "spp", "name"),
    [
        pytest.param(*size, name, marks=() if name in QUICK_SIZES.get(size, ()) else pytest.mark.slow)
        for size, name in product(SIZES, SCRAMBLED)
        if name != "jittered" or size[1] in (1, 4)  # A grid has as many cells in both directions.
    ],
)
def test_screen_of_a_net_hands_out_its_points(side, spp, name):
    """All points once, spp in each pixel; of a sequence, block s is sample s."""
    n = side**2 * spp
    net = SCRAMBLED[name](n.bit_length() - 1)
    sampler = samplers.full_screen(net, side, side)
    assert net.size is None or sampler.fits.spp == spp
    x, y, sample = pixels(side, side, spp)
    index, inside, _ = map(np.asarray, inverted(sampler, x, y, sample))
    assert np.array_equal(np.sort(index), first(n))
    points = np.asarray(net.points(n, dtype=jnp.float64))
    assert np.array_equal((np.stack([x, y], axis=1) + inside) / side, points[index, :2])
    if net.size is None:
        assert np.array_equal(index // side**2, sample)
    if "3d" in name:
        assert np.array_equal(points_of(sampler, x, y, sample, (2,)), points[index, 2:])


@some("make", SCRAMBLED, "plain permutation", "plain hammersley", "larcher_pillichshammer", "sobol")
@pytest.mark.parametrize("side", [4096, *slow(1, 65536)])
def test_screen_of_a_net_at_any_resolution(make, side):
    """On exact 32-bit coordinates: float32 would keep 12 digits of the offset (thesis 5.2.4), at 4096."""
    net = make(32)
    sampler = samplers.full_screen(net, side, side)
    rng = np.random.default_rng(4)
    x, y = (jnp.asarray(rng.integers(0, side, 200, dtype=np.uint32)) for _ in range(2))
    sample = jnp.asarray(rng.integers(0, min(sampler.fits.spp, 2**32 - 1), 200, dtype=np.uint32))
    index, double, single = map(np.asarray, inverted(sampler, x, y, sample))
    exact = np.asarray(at_indices(net, index)) * 2.0**32
    unit = 2**32 // side
    assert np.array_equal(exact // unit, np.stack([x, y], axis=1))
    assert np.array_equal(double * unit, exact % unit)
    assert np.array_equal(single, np.floor(double * 2**24) / 2**24)


OFFSETS = {"uniform": sequences.uniform(4, key=1), "halton": sequences.halton(4)}
each_offsets = pytest.mark.parametrize("offsets", OFFSETS.values(), ids=OFFSETS.keys())


def printed_program(net, m, shifts, jitter):
    """Run the loop of thesis Sect. 5.2.5, with a table for its lookUp: exact points by pixel."""
    n = 4**m
    table = {}
    for i, j in (np.asarray(net.bits(jnp.asarray(first(n)))) >> np.uint32(32 - 2 * m)).tolist():
        table[i >> m, j >> m] = i, j
    points = {}
    for ey in range(2**m):
        for ex in range(2**m):
            sx, sy = (ex + shifts[0]) % 2**m, (ey + shifts[1]) % 2**m
            i, j = table[sx, sy]
            i, j = (i - (shifts[0] << m)) % n, (j - (shifts[1] << m)) % n
            points[ex, ey] = (Fraction(i) + jitter[0]) / n, (Fraction(j) + jitter[1]) / n
    return points


@each_offsets
@pytest.mark.parametrize("jitter", [False, True])
def test_padded_replications_equal_the_printed_program(offsets, jitter):
    net = sequences.larcher_pillichshammer_net(6)
    sampler = samplers.padded_replications(net, SIDE, SIDE, offsets, jitter)
    x, y, _ = pixels(SIDE, SIDE)
    vectors = np.asarray(offsets.points(4, dtype=jnp.float64))
    for s, vector in enumerate(vectors):
        shifts = [int(u * SIDE) for u in vector[:2]]
        # The part of the jitter that 32-bit fractions of a pixel hold.
        fractions = [Fraction(int(u * 2**29), 2**29) if jitter else 0 for u in vector[2:]]
        expected = printed_program(net, 3, shifts, fractions)
        whole = on_screen(sampler, x, y, jnp.full_like(x, s), SIDE)
        for pixel, point in zip(zip(x.tolist(), y.tolist(), strict=True), whole.tolist(), strict=True):
            assert tuple(point) == tuple(map(float, expected[pixel]))
    assert any(int(u * SIDE) for u in vectors[:, :2].ravel())


LOST = {sequences.larcher_pillichshammer_net: {1: 48, 2: 32}, sequences.permutation_net: {4: 32}}


@pytest.mark.parametrize("make, lost", [(sequences.hammersley_net, {}), *LOST.items()])
def test_instances_keep_the_distance_and_may_lose_elementary_intervals(make, lost):
    """All 64 shifts of a net by whole pixels; boxes of 2**-i x 2**(i - 6), i = 3 being the pixels."""
    words = np.asarray(make(6).bits(jnp.asarray(first(64)))) >> np.uint32(26)
    alone = analysis.squared_min_distance(words, side=64)
    # The first 64 points of the Sobol' sequence lie in all 64 pixels: so many shifts.
    sampler = samplers.padded_replications(make(6), SIDE, SIDE, sequences.sobol(2), jitter=False)
    x, y, sample = pixels(SIDE, SIDE, 64)
    points = (on_screen(sampler, x, y, sample, SIDE) * 64).astype(int)
    instances = points.reshape(64, 64, 2).swapaxes(0, 1)
    assert len(np.unique(instances.reshape(64, -1), axis=0)) > 1
    assert {analysis.squared_min_distance(w, side=64) for w in instances} == {alone}
    cells = lambda w, i: len(np.unique((w[:, 0] >> (6 - i)) * 64 + (w[:, 1] >> i)))  # noqa: E731
    counted = {i: sum(cells(w, i) < 64 for w in instances) for i in range(7)}
    assert {i: n for i, n in counted.items() if n} == lost


def test_replications_shift_further_coordinates_by_any_fraction():
    net, offsets = sequences.sobol_net_3d(6), sequences.uniform(5, key=2)
    sampler = samplers.padded_replications(net, SIDE, SIDE, offsets)
    x, y, sample = pixels(SIDE, SIDE, 7)
    third = np.asarray(points_of(sampler, x, y, sample, (2,))).reshape(64, 7)
    vectors = np.asarray(offsets.points(7, dtype=jnp.float64))
    grid = np.sort((third - vectors[:, 2]) % 1, axis=0)
    assert np.array_equal(grid, np.tile(np.arange(64)[:, None] / 64, (1, 7)))
    jitter = (np.asarray(points_of(sampler, x, y, sample)) * SIDE % 1).reshape(64, 7, 2)
    assert np.array_equal(jitter, np.tile(np.floor(vectors[:, 3:] * 2**29) / 2**29, (64, 1, 1)))


SHIFTED = sequences.digital_shift(sequences.hammersley_net(6), key=3)


@pytest.mark.parametrize("net", [*slow(sequences.sobol(2)), SHIFTED])
def test_replications_of_sequences_and_scrambled_nets(net):
    """Of a sequence the first frame in each instance; jitter stays inside the pixel, whatever the points."""
    offsets = OFFSETS["uniform"]
    x, y, sample = pixels(SIDE, SIDE, 5)
    words = np.asarray(offsets.bits(jnp.asarray(first(5))))[np.asarray(sample)]
    moved = (jnp.asarray((np.asarray(p) + (words[:, j] >> 29)) % SIDE) for j, p in enumerate((x, y)))
    inside = np.asarray(points_of(samplers.full_screen(net, SIDE, SIDE), *moved, jnp.zeros_like(sample)))
    sampler = samplers.padded_replications(net, SIDE, SIDE, offsets)
    jitter = (words[:, 2:] >> 3) / 2.0**32
    assert np.array_equal(points_of(sampler, x, y, sample), (inside + jitter) % 1)


@pytest.mark.parametrize("side", [1, 65536])
def test_replications_at_the_smallest_and_the_largest_resolution(side):
    net, offsets = sequences.larcher_pillichshammer_net(32 if side > 1 else 0), OFFSETS["uniform"]
    sampler = samplers.padded_replications(net, side, side, offsets)
    rng = np.random.default_rng(6)
    x, y = (rng.integers(0, side, 100, dtype=np.uint32) for _ in range(2))
    sample = jnp.asarray(first(100))
    words = np.asarray(offsets.bits(sample)).astype(np.uint64)
    unit = np.uint64(2**32 // side)
    moved = [(p + words[:, j] // unit) % side for j, p in enumerate((x, y))]
    column, row = (jnp.asarray(p.astype(np.uint32)) for p in moved)
    index = net.index_in_cell(column, row, side.bit_length() - 1, jnp.zeros_like(sample))
    offset = (np.asarray(net.bits(index)).astype(np.uint64) % unit) * np.uint64(side)
    points = np.asarray(points_of(sampler, jnp.asarray(x), jnp.asarray(y), sample))
    assert np.array_equal(points * 2.0**32, offset + words[:, 2:] // np.uint64(side))


# A smooth scene, so that rounding does not decide.
WAVE = scenes.function(lambda p: jnp.sin(7 * p[..., 0]) * jnp.cos(3 * p[..., 0] + 5 * p[..., 1]), ("x", "y"))
SORTED = {"halton": (sequences.halton(2), 9), "random": (sequences.halton(2, "random", key=5), 9)}
SORTED["xor"] = sequences.digital_shift(sequences.sobol(2), 3), 16
SORTED["padded"] = sequences.larcher_pillichshammer_net(8), 16


@pytest.mark.parametrize("name", few(SORTED, "random", "padded"))
def test_render_equals_sorting_all_points_into_pixels(name):
    (seq, rows), (width, height, spp) = SORTED[name], (12, 9, 5)
    points = np.asarray(seq.points(seq.size or 16 * rows * spp, dtype=jnp.float64))
    if name == "padded":
        sampler = samplers.padded_replications(seq, width, height, 4, jitter=False)
        vectors = np.asarray(sampler.offsets.points(spp, dtype=jnp.float64))
        points = np.concatenate([(points - np.floor(v[:2] * 16) / 16) % 1 for v in vectors])
    else:
        sampler = samplers.full_screen(seq, width, height)
    points = points * [16, rows]
    # Ternary fractions of whole pixels are not exact.
    x, y = np.floor(points + 1e-9).astype(int).T
    values = np.asarray(WAVE(jnp.asarray(points / [width, height], jnp.float32)))
    kept = (x < width) & (y < height)
    assert np.all(np.bincount(y[kept] * width + x[kept], minlength=width * height) == spp)
    expected = np.zeros((height, width))
    np.add.at(expected, (y[kept], x[kept]), values[kept] / spp)
    assert np.allclose(qj.render(WAVE, sampler, width, height, spp), expected, atol=2e-6)


def padded(net, offsets, jitter=True):
    return samplers.padded_replications(net, SIDE, SIDE, offsets, jitter)


test_bad_input_is_named = refused(
    (
        *(samplers.full_screen, sequences.halton(2), 65536, 65536),
        r"width, height must .* got 65536 x 65536, which takes 2\*\*16 x 3\*\*11",
    ),
    (padded, sequences.hammersley_net(8), 1, "net must have one point in each of 8 x 8 .* got 4"),
    (padded, sequences.hammersley_net(5), 1, "net's m must be at least 6 .* got m=5"),
    (
        *(padded, sequences.hammersley_net(6), sequences.sobol(3)),
        "offsets must have 4 dimensions, for 2 shifts and 2 of jitter, got 3",
    ),
    (
        *(padded, sequences.sobol_net_3d(6), sequences.sobol(2), False),
        "offsets must have 3 dimensions, for 3 shifts, got 2",
    ),
    (padded, sequences.halton(2), 1, TypeError, "net must be invertible .* got halton"),
    error=ValueError,
)
