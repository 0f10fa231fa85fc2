import itertools
import math
import re
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from closed_forms import CLOSED_FORMS, KERNELS, exact_square, fractions
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.stats import qmc
from tables import few, slow

import analysis
from analysis._l2 import kernels as double_double
from analysis._l2 import pairs
from analysis._l2.l2_discrepancy import value_and_gradient
from qmcjax import sequences

KINDS = list(CLOSED_FORMS)


def measure(kind):
    return getattr(analysis, f"{kind}_discrepancy")


def sobol(dims, n):
    return np.asarray(sequences.sobol(dims).points(n, dtype=jnp.float64))


def exact_slope(points, kind, i, j):
    """Return a derivative of the discrepancy by a central difference of its square in fractions."""
    step = Fraction(1, 2**40)
    around = []
    for sign in (1, -1):
        moved = [list(p) for p in points]
        moved[i][j] += sign * step
        around.append(exact_square(moved, kind))
    return float((around[0] - around[1]) / (2 * step)) / (2 * math.sqrt(exact_square(points, kind)))


def assert_square(value, points, kind, tolerance=1e-13):
    exact = exact_square(fractions(points), kind)
    assert abs(Fraction(float(value)) ** 2 / exact - 1) < tolerance


def point_sets():
    """Return sets of 16 points in the plane."""
    random = np.random.default_rng(7)
    spread = random.random((16, 2))
    i = np.arange(16)
    return {
        "random": spread,
        "sobol": sobol(2, 16),
        "lattice": np.stack([i / 16, i * 5 % 16 / 16], axis=1),
        "repeated": np.tile(spread[:4], (4, 1)),
        "cluster": 0.3 + spread * 2.0**-30,
        "boundary": random.choice([0.0, 0.5, 1 - 2.0**-53, 1.0], (16, 2)),
        "factors of zero": np.stack([np.where(i < 4, 1.0, spread[:, 0]), spread[:, 1]], axis=1),
        "corner": np.full((16, 2), 1 - 2.0**-53),
        "tiny": spread * 5e-300,
    }


def quadrature(coordinates, kind):
    """Return nodes that integrate the discrepancy's definition along one axis.

    That is weights (q,), whether the points are in the node's set (q, n), and the set's measure (q,).
    Between the coordinates, 0, 1/2 and 1 integrands are polynomials of degree 3 at most.
    """
    ends = np.unique([0.0, 0.5, 1.0, *coordinates])
    nodes, weights = np.polynomial.legendre.leggauss(3)
    nodes, weights = (nodes + 1) / 2, weights / 2
    sizes = np.diff(ends)
    if kind in ("wraparound", "periodic"):
        found = []
        for a, b in itertools.product(range(len(sizes)), repeat=2):
            for (s, u), (t, v) in itertools.product(zip(nodes, weights, strict=True), repeat=2):
                weight = u * v * sizes[a] * sizes[b]
                if a != b:
                    found.append((ends[a] + s * sizes[a], ends[b] + t * sizes[b], weight))
                else:  # two triangles
                    near, far = ends[a] + s * t * sizes[a], ends[a] + s * sizes[a]
                    found += [(near, far, weight * s), (far, near, weight * s)]
        start, stop, weight = np.array(found).T
        x, start, stop = coordinates[None, :], start[:, None], stop[:, None]
        inside = np.where(start < stop, (start <= x) & (x < stop), (x >= start) | (x < stop))
        return weight, inside.astype(float), (stop - start)[:, 0] % 1
    t = (ends[:-1, None] + sizes[:, None] * nodes).ravel()
    weight = (sizes[:, None] * weights).ravel()
    below = (coordinates[None, :] < t[:, None]).astype(float)
    if kind == "l2_star":
        return weight, below, t
    if kind == "symmetric":
        return weight, 2 * below - 1, 2 * t - 1
    low = t < 0.5
    return weight, np.where(low[:, None], below, 1 - below), np.where(low, t, 1 - t)


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "mixture"])
def test_closed_form_is_the_definition(kind):
    """The mean square over sets, in the whole space or in all of its projections."""
    points = np.random.default_rng(3).random((3, 2))
    axes = [quadrature(points[:, j], kind) for j in range(2)]
    projections = [(0, 1)] if kind in ("l2_star", "periodic") else [(0,), (1,), (0, 1)]
    square = 0.0
    for projection in projections:
        weight, inside, volume = np.ones(1), np.ones((1, 3)), np.ones(1)
        for w, f, v in (axes[j] for j in projection):
            weight = np.multiply.outer(weight, w).ravel()
            volume = np.multiply.outer(volume, v).ravel()
            inside = (inside[:, None] * f[None]).reshape(-1, 3)
        square += weight @ (inside.mean(axis=1) - volume) ** 2
    np.testing.assert_allclose(square, float(exact_square(fractions(points), kind)), rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_equals_the_closed_form_and_its_derivatives(kind):
    """In fractions; derivatives where there are any. Traced points are not checked: they may be at 1."""
    with jax.enable_x64(True):
        value_and_grad = jax.jit(jax.value_and_grad(measure(kind)))
        for name, points in point_sets().items():
            value, slopes = value_and_grad(points)
            assert value.shape == () and value.dtype == np.float64
            assert_square(value, points, kind)
            assert np.isfinite(slopes).all()
            if name in ("random", "factors of zero"):
                for i, j in [(0, 1), (5, 1), (15, 0)]:
                    expected = exact_slope(fractions(points), kind, i, j)
                    np.testing.assert_allclose(slopes[i, j], expected, rtol=1e-8, atol=1e-13)


coordinates = st.one_of(
    st.floats(0, 1, exclude_max=True),
    st.integers(0, 7).map(lambda k: k / 8),
    st.sampled_from([0.0, 5e-324, 1 - 2.0**-53]),
)


@settings(max_examples=10)
@given(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=16))
def test_any_points(some):
    """Repeated to 16, so that one program serves."""
    points = np.array([some[i % len(some)] for i in range(16)])
    for kind in ("l2_star", "mixture"):
        value = measure(kind)(points)
        assert value.dtype == np.float64
        assert_square(value, points, kind)


SCIPY = {"l2_star": "L2-star", "centered": "CD", "wraparound": "WD", "mixture": "MD"}


@pytest.mark.parametrize("shape", [(16, 2), *slow((1, 3), (700, 1), (301, 5))])
@pytest.mark.parametrize("kind", few(SCIPY, "l2_star", "mixture"))
def test_equals_scipy(kind, shape):
    """To 1e-12 but for SciPy's rounding errors: they are relative to its sums, which cancel."""
    points = np.random.default_rng(2).random(shape)
    expected = qmc.discrepancy(points, method=SCIPY[kind])
    square = expected**2 if kind == "l2_star" else expected
    size = float(CLOSED_FORMS[kind][0]) ** points.shape[1]
    np.testing.assert_allclose(float(measure(kind)(points)) ** 2, square, rtol=1e-12, atol=1e-13 * size)


@pytest.mark.parametrize(
    "case", [("mixture", (14, 5), 4), *slow(("centered", (33, 1), 4), ("mixture", (22, 3), 8))]
)
def test_tiles(monkeypatch, case):
    """Tiles of which the last one is not full make up the value, and the derivatives in some coordinates."""
    kind, (n, dims), tile = case
    monkeypatch.setattr(pairs, "_TILE", tile)
    points, kernel = np.random.default_rng(5).random((n, dims)), KERNELS[kind]
    with jax.enable_x64(True):
        value, slopes = value_and_gradient(jnp.asarray(points), kernel, True)
        assert_square(value, points, kind)
        value, nothing = value_and_gradient(jnp.asarray(points), kernel, False)
        assert nothing.shape == (0, dims)
        assert_square(value, points, kind)
    for i in range(0, n, max(3, n // 5)):
        expected = exact_slope(fractions(points), kind, i, i % dims)
        np.testing.assert_allclose(slopes[i, i % dims], expected, rtol=1e-8, atol=1e-13)


def full_precision_sobol(dims, bits):
    """Return 2^bits Sobol' points with random digits beyond, as integers and as floats: 40 digits."""
    fixed = (sobol(dims, 2**bits) * 2**40).astype(np.int64)
    fixed += np.random.default_rng(4).integers(0, 2 ** (40 - bits), fixed.shape)
    return fixed, fixed / 2.0**40


def star_square(fixed):
    """Return the square of the L2 star discrepancy of points of 40 digits, in integers."""
    n, dims = fixed.shape
    size = 2**40
    once = sum(math.prod(size**2 - x**2 for x in p) for p in fixed.tolist())
    twice = sum(np.prod(size - np.maximum(p, fixed).astype(object), axis=1).sum() for p in fixed)
    sums = Fraction(-2 * n * once, (2 * size**2) ** dims) + Fraction(twice, size**dims)
    return Fraction(1, 3**dims) + sums / n**2


@pytest.mark.slow
@pytest.mark.parametrize("dims, digits", [(2, 10), (1, 11), (3, 11)])
def test_large_sets_lose_nothing_by_cancellation(dims, digits):
    """Of 1024 points, the three sums cancel to a part of 1e-6."""
    fixed, points = full_precision_sobol(dims, digits)
    value = analysis.l2_star_discrepancy(points)
    assert abs(Fraction(float(value)) ** 2 / star_square(fixed) - 1) < 1e-12


@pytest.mark.slow
def test_derivatives_of_large_sets():
    """The same points; where they are equal in a coordinate, that is with themselves, half a step."""
    n = 1024
    points = sobol(2, n)
    with jax.enable_x64(True):
        value, slopes = jax.value_and_grad(analysis.l2_star_discrepancy)(jnp.asarray(points))
    x, y = points.T
    right = 1 - np.maximum(y[:, None], y)
    step = (x[:, None] > x) + 0.5 * np.eye(n)
    by_x = n * x * (1 - y**2) - 2 * (step * right).sum(axis=1)
    np.testing.assert_allclose(slopes[:, 0], by_x / (2 * n**2 * float(value)), rtol=0, atol=1e-12)


def test_best_points_on_the_line():
    """Midpoints have the least discrepancies, multiples of 1 / n; a vector is a column."""
    points = (np.arange(8) + 0.5) / 8
    for shaped in (points, points[:, None]):
        np.testing.assert_allclose(analysis.l2_star_discrepancy(shaped), 1 / (8 * math.sqrt(12)), rtol=1e-14)
        np.testing.assert_allclose(
            analysis.symmetric_discrepancy(shaped), 2 / (8 * math.sqrt(12)), rtol=1e-14
        )


@pytest.mark.slow
def test_transforms():
    """float32 in, traced without 64-bit types: float32 out, from the same computation."""
    points = sequences.sobol(2).points(16)
    expected = analysis.l2_star_discrepancy(points)
    assert expected.dtype == np.float64
    jitted = jax.jit(analysis.l2_star_discrepancy)(points)
    value, slopes = jax.value_and_grad(lambda p: 2 * analysis.l2_star_discrepancy(p))(points)
    assert jitted.dtype == value.dtype == slopes.dtype == np.float32
    assert float(jitted) == float(value) / 2 == np.float32(float(expected))
    wide = sequences.sobol(2).points(16, dtype=jnp.float64)
    wide_slopes = jax.grad(analysis.l2_star_discrepancy)(wide)
    assert wide_slopes.dtype == np.float64
    np.testing.assert_allclose(slopes, 2 * np.asarray(wide_slopes), rtol=1e-6, atol=1e-9)
    several = jnp.stack([points, points[:, ::-1], points * 0.5])
    rows = jax.vmap(analysis.l2_star_discrepancy)(several)
    expected = [float(analysis.l2_star_discrepancy(p)) for p in several]
    np.testing.assert_allclose(rows, expected, rtol=1e-7)


@pytest.mark.parametrize("n, dims", [(4096, 2), (4096, 3), (4096, 4)])
def test_memory_is_linear(n, dims):
    """The program has no array of more than 64 times n d numbers."""
    with jax.enable_x64(True):
        points = jax.ShapeDtypeStruct((n, dims), np.float64)
        text = jax.jit(jax.value_and_grad(analysis.mixture_discrepancy)).lower(points).as_text()
    shapes = re.findall(r"tensor<((?:[0-9]+x)+)", text)
    largest = max(math.prod(map(int, shape.rstrip("x").split("x"))) for shape in shapes)
    assert n * dims <= largest <= 64 * n * dims


test_errors_of_traced_points = refused(
    ((2**24 + 1, 1), np.float32, "points must be at most 16777216, got n=16777217"),
    call=lambda shape, dtype: jax.eval_shape(
        analysis.l2_star_discrepancy, jax.ShapeDtypeStruct(shape, dtype)
    ),
)


def test_double_double():
    """Sums and products of compiled programs hold what float64 rounds off, and totals are exact."""
    with jax.enable_x64(True):
        x, y = jnp.asarray(np.random.default_rng(9).random((2, 64)) - 0.5)
        exactly = [(double_double.two_sum, Fraction.__add__), (double_double.two_product, Fraction.__mul__)]
        for operation, exact in exactly:
            high, low = map(np.asarray, jax.jit(operation)(x, y))
            for a, b, h, e in zip(np.asarray(x), np.asarray(y), high, low, strict=True):
                assert Fraction(float(h)) + Fraction(float(e)) == exact(
                    Fraction(float(a)), Fraction(float(b))
                )
        high, low = jax.jit(lambda x: double_double.total((x, 0 * x), 64.0))(x)
        assert Fraction(float(high)) + Fraction(float(low)) == sum(Fraction(float(v)) for v in x)
