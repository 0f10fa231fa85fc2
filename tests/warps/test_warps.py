"""Warps of the unit cube: the same theorems for all, and what each has of its own."""

from functools import cache

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from refusals import refused
from scipy import special, stats

from qmcjax import sequences, warps

CORNERS = np.array([[0.0, 0.0, 1.0], [3.0, 0.5, 0.0], [1.0, 2.0, -1.0]])
WEIGHTS = np.array([3.0, 0.0, 1.0, 1e-3, 5.0, 0.0])

WARPS = {
    "normal": warps.normal(),
    "normal(3)": warps.normal(3),
    "exponential(2)": warps.exponential(2),
    "triangle": warps.triangle(CORNERS[:, :2]),
    "triangle in space": warps.triangle(CORNERS),
    "disc": warps.disc(),
    "sphere": warps.sphere(),
    "hemisphere": warps.hemisphere(),
    "simplex(1)": warps.simplex(1),
    "simplex(4)": warps.simplex(4),
}
ALL = {**WARPS, "discrete": warps.discrete(WEIGHTS)}

each = pytest.mark.parametrize("name", WARPS)
each_of_all = pytest.mark.parametrize("name", ALL)
both = pytest.mark.parametrize("dtype", [np.float32, np.float64])


def edges(dims, dtype):
    """Return points of the cube with all coordinates at its ends, at the middle, and next to these."""
    one = np.array([0, np.finfo(dtype).tiny, 2**-24, 0.25, 0.5, 0.75, 1], dtype)
    one = np.unique([one, np.nextafter(one, dtype(0.5))])
    one = one[one < 1]
    grid = np.stack(np.meshgrid(*[one] * min(dims, 2)), axis=-1).reshape(-1, min(dims, 2))
    return np.concatenate([grid, np.repeat(grid[:, :1], dims - grid.shape[1], axis=1)], axis=1)


def points(dims, count=4096):
    """Return points of all dtypes' grids: multiples of 2**-23, but for the ends."""
    generator = np.random.default_rng(5)
    return (generator.integers(1, 2**23, (count, dims)) / 2**23).astype(np.float32)


# -- all


@jax.jit
def everything(warp, given):
    values = warp(given)
    back = warp.inverse(values)
    # In reverse: there a guarded root or quotient may still give NaN.
    return values, back, warp(back), warp.density(values), jax.vmap(jax.jacrev(warp))(given)


@cache
def all_of(name, dtype):
    """Return edges and then points, and everything of them, by one program."""
    warp = WARPS[name]
    given = np.concatenate([edges(warp.dims, dtype), points(warp.dims).astype(dtype)])
    with jax.enable_x64(True):
        return given, *map(np.asarray, everything(warp, given))


@both
@each
def test_values_and_derivatives_are_finite(name, dtype):
    """At all ends, at the centre and on the diagonals; the dtype of points stays."""
    warp, count = WARPS[name], len(edges(WARPS[name].dims, dtype))
    given, values, back, _, density, slopes = (array[:count] for array in all_of(name, dtype))
    assert values.dtype == back.dtype == density.dtype == dtype
    assert values.shape == (len(given), warp.length)
    assert all(np.isfinite(each).all() for each in (values, density, slopes))
    assert (back >= 0).all() and (back < 1).all()


@both
@each
def test_the_inverse_is_one(name, dtype):
    """Both ways."""
    count = len(edges(WARPS[name].dims, dtype))
    given, values, back, again, *_ = (array[count:] for array in all_of(name, dtype))
    assert back.shape == given.shape == (4096, WARPS[name].dims)
    np.testing.assert_allclose(back, given, rtol=0, atol=8 * np.finfo(dtype).eps)
    inner = (given > 1e-3).all(axis=1) & (given < 1 - 1e-3).all(axis=1)
    np.testing.assert_allclose(again[inner], values[inner], rtol=0, atol=1e4 * np.finfo(dtype).eps)


def volumes(jacobians):
    """Return by how much a map stretches volumes, also onto surfaces in a space of more dimensions."""
    gram = np.einsum("nij,nik->njk", jacobians, jacobians)
    return np.sqrt(np.linalg.det(gram))


@each
def test_the_density_is_the_reciprocal_of_the_stretched_volume(name):
    """Everywhere: maps of constant density preserve areas, up to a factor."""
    count = len(edges(WARPS[name].dims, np.float64))
    *_, density, jacobians = (array[count:] for array in all_of(name, np.float64))
    if name.startswith("simplex"):
        jacobians = jacobians[:, :-1]  # its density is per volume of all coordinates but one
    np.testing.assert_allclose(density * volumes(jacobians), 1, rtol=1e-8)


@each_of_all
def test_compiled_and_mapped_they_are_the_same(name):
    warp = ALL[name]
    given = jnp.asarray(points(warp.dims, 64))
    values = np.asarray(warp(given))

    @jax.jit
    def compiled(warp, given):
        return warp(given), jax.vmap(warp)(given), warp(given.reshape(8, 8, warp.dims))

    for found in compiled(warp, given):
        np.testing.assert_allclose(found.reshape(values.shape), values, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("side", [1e-15, 1e-9, 1e9, 1e15])
def test_triangles_of_any_size_are_inverted(side):
    triangle, given = warps.triangle(side * CORNERS), points(2, 64)
    values = triangle(given)
    assert np.allclose(triangle.inverse(values), given, atol=1e-5)
    wanted = warps.triangle(CORNERS).density(values / np.float32(side))
    assert np.allclose(triangle.density(values) * np.float32(side) ** 2, wanted, rtol=1e-4)
    assert np.all(wanted > 0)


@pytest.mark.parametrize("side", [1, 1e-3, 1e-6])
def test_densities_of_small_triangles_far_away_are_exact(side):
    far = warps.triangle(np.array([[1, 1], [1 + side, 1], [1, 1 + side]]))
    assert float(far.density(far([[0.3, 0.4]]))[0]) * side**2 == pytest.approx(2, rel=1e-6)


def test_off_the_image_the_density_is_0():
    assert warps.disc().density([0.8, 0.8]) == 0
    assert warps.hemisphere().density([0.6, 0.0, -0.8]) == 0
    assert warps.exponential(2).density([1.0, -0.1]) == 0
    assert warps.simplex(2).density([0.5, 0.6, -0.1]) == 0
    assert warps.simplex(2).density([0.5, 0.3, 0.1]) == 0
    np.testing.assert_array_equal(
        warps.triangle([[0, 0], [1, 0], [0, 1]]).density([[0.2, 0.7], [0.6, 0.6], [-0.1, 0.5], [0.5, -0.1]]),
        [2, 0, 0, 0],
    )


# -- distributions, by regions that the map itself does not know


def regions(name, values):
    """Return the number of each value's region, and the probabilities of the regions."""
    if name.startswith("normal"):
        quantiles = stats.norm.ppf(np.arange(1, 6) / 6)
        digit = np.searchsorted(quantiles, values)
        return digit @ 6 ** np.arange(values.shape[1]), np.full(6 ** values.shape[1], 6.0 ** -values.shape[1])
    if name.startswith("exponential"):
        digit = np.minimum(values, 3).astype(int)  # whole parts, and all from 3 on
        one = np.exp(-np.arange(4)) * np.r_[np.full(3, 1 - np.exp(-1)), 1]
        return digit[:, 0] * 4 + digit[:, 1], np.outer(one, one).ravel()
    if name.startswith("triangle"):
        corners = CORNERS[:, : values.shape[1]]
        ones = np.ones((len(values), 1))
        weights = np.linalg.lstsq(np.vstack([corners.T, ones[:3].T]), np.hstack([values, ones]).T)[0]
        which = np.argmax(weights, axis=0)  # nearest corner, three equal parts
        deep = (np.min(weights, axis=0) > 1 / 6).astype(int)  # a triangle of half the side
        return which * 2 + deep, np.tile([0.75, 0.25], 3) / 3
    if name == "disc":
        ring = np.minimum((np.sum(values**2, axis=1) * 5).astype(int), 4)
        sector = np.floor(np.arctan2(values[:, 1], values[:, 0]) / (2 * np.pi) * 7 + 0.3).astype(int) % 7
        return ring * 7 + sector, np.full(35, 1 / 35)
    if name in ("sphere", "hemisphere"):
        # By height over another axis, after Archimedes, or by the cosine over z.
        height = values[:, 0] if name == "sphere" else 2 * values[:, 2] ** 2 - 1
        other = values[:, 1:] if name == "sphere" else values[:, :2]
        layer = np.minimum(((height + 1) * 2.5).astype(int), 4)
        sector = np.floor(np.arctan2(other[:, 1], other[:, 0]) / (2 * np.pi) * 7 + 0.3).astype(int) % 7
        return layer * 7 + sector, np.full(35, 1 / 35)
    # Simplex: which coordinate is the largest, and whether the first exceeds 1/5, with probability (4/5)**d.
    most, far = np.argmax(values, axis=1), values[:, 1] > 0.2
    dims = values.shape[1] - 1
    counted = far.mean(), 0.8**dims
    assert abs(counted[0] - counted[1]) < 5 * np.sqrt(counted[1] * (1 - counted[1]) / len(values))
    return most, np.full(dims + 1, 1 / (dims + 1))


@each
def test_regions_get_their_probability(name):
    """Chi-squared of regions, of random points; 5 sigma."""
    warp = WARPS[name]
    given = np.random.default_rng(11).random((20000, warp.dims), np.float32)
    number, probabilities = regions(name, np.asarray(warp(given), np.float64))
    assert np.isclose(probabilities.sum(), 1)
    expected = probabilities * len(given)
    counted = np.bincount(number, minlength=len(expected))
    statistic = ((counted - expected) ** 2 / expected).sum()
    freedom = len(expected) - 1
    assert abs(statistic - freedom) < 5 * np.sqrt(2 * freedom + np.sum(1 / expected))


# -- normal


def test_normals_are_accurate_in_both_tails():
    """Float64 against scipy and mpmath down to the least number, float32 against float64."""
    generator = np.random.default_rng(3)
    low = 2.0 ** -generator.uniform(0, 1021, 400)
    high = 1 - 2.0 ** -generator.uniform(1, 53, 400)
    given = np.concatenate([low, high, generator.random(400)])
    warp = warps.normal()
    with jax.enable_x64(True):
        found = np.asarray(warp(given[:, None]))[:, 0]
    np.testing.assert_allclose(found, special.ndtri(given), rtol=4e-15)
    few = given[::100]
    exact = [float(-mpmath.sqrt(2) * mpmath.erfinv(1 - 2 * mpmath.mpf(float(u)))) for u in few[4:]]
    np.testing.assert_allclose(found[::100][4:], exact, rtol=4e-15)
    single = np.float32(given[given > 2.0**-125])
    single = single[single < 1]
    expected = special.ndtri(single.astype(float))
    np.testing.assert_allclose(warp(single[:, None])[:, 0], expected, rtol=4e-7, atol=4e-7)


@both
def test_all_coordinates_of_sequences_have_finite_normals(dtype):
    """The ends of their grid; 0 becomes the centre of its cell, the others stay, in order."""
    side = 2.0**-24 if dtype == np.float32 else 2.0**-32
    with jax.enable_x64(True):
        given = jnp.asarray(np.array([0, side, 2 * side, 0.5, 1 - side], dtype))[:, None]
        found = np.asarray(warps.normal()(given))[:, 0]
        subnormal = warps.normal()(jnp.asarray([[np.finfo(dtype).tiny / 4]], dtype))
    expected = special.ndtri([side / 2, side, 2 * side, 0.5, 1 - side])
    np.testing.assert_allclose(found, expected, rtol=4e-7 if dtype == np.float32 else 4e-15)
    assert (np.diff(found) > 0).all() and np.isfinite(subnormal).all()


def test_derivatives_of_normals_are_reciprocal_densities():
    with jax.enable_x64(True):
        given = np.array([1e-200, 1e-9, 0.3, 0.5, 1 - 1e-9])
        slopes = jax.jit(jax.vmap(jax.grad(lambda u: warps.normal()(u[None])[0])))(given)
    np.testing.assert_allclose(slopes, 1 / stats.norm.pdf(special.ndtri(given)), rtol=1e-11)


# -- others


def test_small_exponentials_keep_their_digits():
    given = np.float32(2.0 ** -np.arange(1, 25))
    found = np.asarray(warps.exponential()(given[:, None]))[:, 0]
    np.testing.assert_allclose(found, -np.log1p(-given.astype(float)), rtol=2e-7)


def test_exponentials_and_inverses_are_those_of_mpmath():
    """In float64, at both ends too; units in the last place of the exact function of the float64 number."""

    def exact_parts(values, dims):
        for row in values:
            exact = [mpmath.mpf(float(value)) for value in row]
            yield from (1 - (1 - exact[j] / sum(exact[j:])) ** (dims - j) for j in range(dims))

    def off(found, exact):
        wanted = [float(one) for one in exact]
        errors = [mpmath.mpf(float(one)) - of for one, of in zip(np.ravel(found), exact, strict=True)]
        return max(abs(np.array(errors, float) / np.spacing(wanted)))

    generator = np.random.default_rng(4)
    with jax.enable_x64(True), mpmath.workdps(80):
        ends = 2.0 ** -generator.uniform(1, 53, 500)
        given = np.concatenate([[0.41395588246519277], ends, 1 - ends, generator.random(2000)])[:, None]
        values = np.asarray(warps.exponential()(given))
        assert off(values, [-mpmath.log1p(-mpmath.mpf(float(p))) for p in given[:, 0]]) < 2
        back = warps.exponential().inverse(values)
        assert off(back, [-mpmath.expm1(-mpmath.mpf(float(x))) for x in values[:, 0]]) < 4
        for dims in (1, 5):
            values = np.asarray(warps.simplex(dims)(given[:3000].reshape(-1, dims)))
            assert off(warps.simplex(dims).inverse(values), list(exact_parts(values, dims))) < 4
        for low in range(8):
            values = -low - generator.random((50, 1))
            back = warps.normal().inverse(values)
            assert off(back, [mpmath.ncdf(float(x)) for x in values[:, 0]]) < 3 * (1 + low**2)


def test_the_disc_maps_squares_to_circles():
    side = np.linspace(-1, 1, 33, dtype=np.float32)[:-1]
    ring = np.stack([np.full_like(side, -0.5), side / 2], axis=-1)
    radius = np.linalg.norm(warps.disc()((ring + 1) / 2), axis=1)
    np.testing.assert_allclose(radius, 0.5, rtol=1e-6)


@pytest.mark.parametrize("name", ["triangle", "disc", "hemisphere", "sphere"])
def test_neighbours_stay_neighbours(name):
    """No jump: on a grid of side 1/512, steps are as long as the largest stretch of the map allows."""
    grid = (np.stack(np.meshgrid(*[np.arange(512)] * 2), axis=-1) + 0.5).astype(np.float32) / 512
    values = np.asarray(WARPS[name](grid))
    steps = max(np.linalg.norm(np.diff(values, axis=a), axis=-1).max() for a in (0, 1))
    # Heights change fastest next to the poles and the rim: by the root of a step.
    most = {"triangle": 4 / 512, "disc": 3 / 512}.get(name, 2 * np.sqrt(2 / 512))
    assert steps < most


def test_cosines_keep_their_digits_next_to_the_rim():
    given = np.float32([[2.0**-20, 0.3], [0.6, 1 - 2.0**-20]])
    margin = 2.0**-19
    np.testing.assert_allclose(warps.hemisphere()(given)[:, 2], np.sqrt(margin * (2 - margin)), rtol=1e-6)


def test_directions_are_unit_vectors():
    for warp in (warps.sphere(), warps.hemisphere()):
        length = np.linalg.norm(warp(points(2)), axis=1)
        np.testing.assert_allclose(length, 1, rtol=1e-6)


def test_simplices_sum_to_1_in_the_smallest_parts_too():
    values = np.asarray(warps.simplex(20)(points(20)), np.float64)
    np.testing.assert_allclose(values.sum(axis=1), 1, rtol=1e-5)
    assert (values > 0).all()


# -- discrete


@jax.jit
def choices(choose, given):
    found = choose(given)
    return found, choose(choose.inverse(found)), choose.density(np.arange(choose.count))


@both
def test_choices_of_a_net_have_their_shares(dtype):
    """Of 2**16 stratified points, each choice gets its share up to one."""
    with jax.enable_x64(True):
        given = sequences.sobol(1).points(2**16, dtype=dtype)
        found, again, density = map(np.asarray, choices(warps.discrete(WEIGHTS), given))
    counted, shares = np.bincount(found, minlength=len(WEIGHTS)), WEIGHTS / WEIGHTS.sum()
    assert (abs(counted - shares * 2**16) < 1).all() and (again == found).all()
    assert (counted[WEIGHTS == 0] == 0).all()
    np.testing.assert_allclose(density, shares, rtol=1e-6, atol=2**-32)


@pytest.mark.parametrize("weights", [[2.0], [0, 3.0], [3.0, 0, 0], [1, 1e-300], [1e300, 1e300], [1e-320, 0]])
def test_extreme_weights(weights):
    """A choice without weight never comes, at the ends neither; probabilities sum to 1."""
    choose = warps.discrete(weights)
    with jax.enable_x64(True):
        given = np.array([0, 0.25, 0.5, 0.75, 1 - 2.0**-32, 1 - 2.0**-53])[:, None]
        found, again, density = map(np.asarray, choices(choose, given))
    assert (np.asarray(weights)[found] > 0).all()
    assert density.shape == (len(weights),)
    assert density.sum() == 1
    assert (again == found).all()


# -- errors

test_bad_input_is_named = refused(
    (lambda: warps.disc()([[0.5, 1.0]]), r"points must be in \[0, 1\) in float32, got"),
    (lambda: warps.triangle([[0], [1], [2]]), r"vertices must have shape \(3, n\), n at least 2"),
    (lambda: warps.discrete([1, 2]).density(2), r"values must be integers in \[0, 1\], got 2"),
    (TypeError, lambda: jax.jit(warps.discrete)(jnp.ones(2)), "weights must be known before tracing"),
    error=ValueError,
)


# -- tent


@both
def test_the_tent_is_exact_and_two_to_one(dtype):
    u = np.array([0, 0.125, 0.25, 0.5, 0.75, 0.9375], dtype)
    assert np.array_equal(warps.tent(u), np.array([0, 0.25, 0.5, 1, 0.5, 0.125], dtype))
    assert warps.tent(jnp.asarray(u)).dtype == dtype or dtype == np.float64
    grid = (np.arange(256, dtype=dtype) + dtype(0.5)) / 256
    assert np.array_equal(np.sort(warps.tent(grid)), np.repeat((2 * np.arange(128) + 1) / 256 * 1.0, 2))


test_bad_points_of_the_tent_are_named = refused(
    (warps.tent, np.array([0.0, 1.0], np.float32), r"points must be in \[0, 1\) in float32, got"),
    (warps.tent, object(), TypeError, "points must be real numbers, got <object"),
    error=ValueError,
)
