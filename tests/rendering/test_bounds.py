"""Integrands: over boxes, which may be infinite, and with values of any structure."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.integrate import nquad, quad
from tables import few, slow

import qmcjax as qj
from qmcjax import sequences
from qmcjax.integration._boxes import over_box
from qmcjax.integration._means import columns, of_columns

INF = np.inf
BOXES = {
    "a side": (lambda x, xp: xp.exp(x[0]), [(-2, 0.5)]),
    "negative sides": (lambda x, xp: x[0] * x[1] ** 2, [(-3, -2), (1, 4)]),
    "a half-line": (lambda x, xp: xp.exp(-x[0]) * x[0], [(1, INF)]),
    "the other half-line": (lambda x, xp: xp.exp(x[0]), [(-INF, 2)]),
    "a line": (lambda x, xp: 1 / (1 + x[0] ** 2), (-INF, INF)),
    "a slow line": (lambda x, xp: xp.exp(-abs(x[0] - 1) / 2), (-INF, INF)),
    "all at once": (lambda x, xp: x[1] * xp.exp(-(x[0] ** 2) - x[2]), [(-INF, INF), (0, 3), (0, INF)]),
}


@pytest.mark.parametrize("dtype", [jnp.float32, *slow(jnp.float64)])
@pytest.mark.parametrize("name", few(BOXES, "negative sides", "all at once"))
def test_integrals_are_those_of_scipy(name, dtype):
    function, bounds = BOXES[name]
    sides = [bounds] if isinstance(bounds, tuple) else bounds
    if len(sides) == 1:
        exact = quad(lambda x: function([x], np), *sides[0])[0]
    else:
        exact = nquad(lambda *x: function(x, np), sides)[0]
    how = {"bounds": bounds, "dtype": dtype}
    sequence = sequences.sobol(len(sides))
    found = qj.integrate(lambda x: function(x.T, jnp), sequence, 2**12, replicates=8, key=1, **how)
    low, high = found.interval(1 - 5e-7)
    assert low < exact < high and high - low < 0.05 * abs(exact)
    alone = float(qj.integrate(lambda x: function(x.T, jnp), sequence, 2**12, **how))
    assert abs(alone - exact) < 0.02 * abs(exact)  # the first point, 0 in all coordinates, included


def test_one_pair_is_for_all_dimensions():
    """The volume of a ball in 3-D, of bools; and a tree of them and of floats."""

    def values(x):
        return {"ball": jnp.sum(x * x, axis=1) < 4, "side": x[:, 0] + 1}

    found = qj.integrate(values, sequences.sobol(3), 2**14, bounds=(-2, 2))
    assert abs(found["ball"] - 4 / 3 * np.pi * 8) < 0.1
    assert abs(found["side"] - 64) < 0.1


def test_bounds_have_derivatives():
    """By an end it is the value there, Leibniz; of a box in 2-D also the integral along the side."""

    def integral(high, low):
        bounds = jnp.stack([jnp.stack([low, high]), jnp.float32([0, 2])])
        return qj.integrate(lambda x: x[:, 0] ** 2 * x[:, 1], sequences.sobol(2), 4096, bounds=bounds)

    slopes = jax.grad(integral, argnums=(0, 1))(jnp.float32(3), jnp.float32(1))
    np.testing.assert_allclose(slopes, (9 * 2, -1 * 2), rtol=2e-3)


FAR = {
    "a short side": (lambda x: x[:, 0], (100, 100.1), 10.005, True),
    "a step": (lambda x: x[:, 0] < 100.05, (100, 100.1), 0.05, True),
    "no float32": (lambda x: x[:, 0] - 2**24, (2**24, 2**24 + 3), 4.5, False),
    "negative": (lambda x: jnp.sin(9 * (x[:, 0] + 1e5)), (-1e5 - 0.3, -1e5), (np.cos(2.7) - 1) / 9, False),
    "a half-line": (lambda x: jnp.exp(1e5 - x[:, 0]), (1e5, INF), 1, False),
}


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
@pytest.mark.parametrize("name", FAR)
def test_far_from_the_origin_intervals_hold_or_lack_places(name, dtype):
    function, bounds, exact, enough = FAR[name]
    found = qj.integrate(function, sequences.sobol(1), 2**14, replicates=8, key=1, bounds=bounds, dtype=dtype)
    low, high = found._interval(1 - 5e-7)
    assert low <= exact <= high and found.reached == (enough or dtype == jnp.float64)
    assert found.reached or "different places along a side of bounds" in found.reason
    assert found.reached is False or high - low < 2e-3 * abs(exact) + 2 * found.rounding


@pytest.mark.parametrize("low, high", [(100.1, 100.2), (-1e3 - 0.3, -1e3), (2**24 - 5, 2**24 + 3)])
def test_places_are_the_nearest_numbers(low, high):
    u = (np.arange(2**12) + 0.5) / 2**12
    box, volume, _ = over_box(lambda x: x, (low, high), 1, np.dtype(np.float32))
    found = np.asarray(box.places(jnp.float32(u)[:, None]))[:, 0]
    nearest = np.float32([float(Fraction(low) + (Fraction(high) - Fraction(low)) * Fraction(x)) for x in u])
    assert np.mean(found == nearest) > 0.99 and volume == high - low


def test_limits_are_of_the_function():
    """Not of its product with the volume, 6."""
    how = {"replicates": 64, "key": 1, "interval": "betting", "limits": (0, 1)}
    found = integral([(0, 2), (1, 4)], lambda x: x[:, 0] < 1, **how)
    assert 0 < found.interval()[0] < 3 < found.interval()[1] < 6


def integral(bounds, function=lambda x: x[:, 0], dims=2, **more):
    return qj.integrate(function, sequences.sobol(dims), 16, bounds=bounds, **more)


test_bad_bounds_are_named = refused(
    (lambda: integral([(0, 1), (2, 1)]), r"low < high, got \(2.0, 1.0\) in dimension 1"),
    (lambda: integral((INF, INF)), r"low < high, got \(inf, inf\)"),
    (TypeError, lambda: integral("ab"), "bounds must be made of real numbers, got 'ab'"),
    (lambda: integral((0, 1e39)), "bounds must have ends and a volume that float32 can tell apart"),
    (lambda: integral((1, 1 + 1e-12)), "that float32 can tell apart, got"),
    (lambda: integral((0, INF), replicates=4, key=1, limits=(0, 1)), "limits must be None for bounds of an"),
    (lambda: jax.grad(lambda low: integral((low, INF)))(1.0), "bounds must be known or finite"),
    (lambda: integral((0, 2), lambda x: 1 / (x[:, 0] - 1), 1), r"NaN or infinity at point 1, \(1.0\)"),
    error=ValueError,
)


VALUES = {
    "a": np.arange(6, dtype=np.float64).reshape(3, 2),
    "b": (np.array([1.5, 3, -2], np.float32), np.arange(3, dtype=np.int32)),
}


@pytest.mark.parametrize("xp", [np, jnp])
def test_columns_become_the_values_again(xp):
    with jax.enable_x64(True):
        found = of_columns(xp.asarray(columns(VALUES, np.dtype(np.float64))), VALUES, np.dtype(np.float64))
    for leaf, wanted in zip(jax.tree.leaves(found), jax.tree.leaves(VALUES), strict=True):
        assert isinstance(leaf, np.ndarray if xp is np else jax.Array)
        np.testing.assert_array_equal(leaf, wanted)
        assert leaf.dtype == (np.float64 if wanted.dtype == np.int32 else wanted.dtype)
