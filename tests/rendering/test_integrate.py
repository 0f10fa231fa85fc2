"""The mean of a function over a sequence, against the points themselves in float64."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy import stats
from scipy.integrate import qmc_quad
from scipy.stats import qmc
from tables import few, slow, slow_cases, some

import qmcjax as qj
from qmcjax import sequences

TABULATED = 8 * 4096
XOR = sequences.digital_shift(sequences.sobol(3), key=1)
SEQUENCES = {"digital": sequences.sobol(3), "many coordinates": sequences.sobol(9)}
SEQUENCES |= {"scrambled": sequences.owen(XOR, key=2), "base b": sequences.halton(3)}
SEQUENCES["lattice"] = sequences.lattice(3)


def squares(points):
    return points * points


def inside(points):
    return points[:, 0] + points[:, 1] < 1


def product(points):
    return points[:, 0] * points[:, 1]


@pytest.mark.parametrize("n, start", [*slow_cases((1, 7)), (2 * TABULATED + 99, 3 * 4096)])
@some("sequence", SEQUENCES, "digital", "scrambled", "base b")
def test_the_mean_is_that_of_the_points(sequence, n, start):
    points = np.asarray(sequence.points(n, start), np.float64)
    measured = qj.integrate(squares, sequence, n, start)
    assert measured.dtype == jnp.float32
    assert np.allclose(measured, (points**2).mean(axis=0), rtol=3e-7, atol=0)


def test_float64_keeps_its_digits():
    sequence = SEQUENCES["scrambled"]
    points = np.asarray(sequence.points(3 * TABULATED, dtype=jnp.float64))
    measured = qj.integrate(squares, sequence, 3 * TABULATED, dtype=jnp.float64)
    assert measured.dtype == jnp.float64
    exact = [math.fsum(column) / len(points) for column in (points**2).T]
    assert np.allclose(measured, exact, rtol=4e-16, atol=0)


def test_indicators_are_counted():
    points = np.asarray(sequences.sobol(2).points(2**17))
    assert qj.integrate(inside, sequences.sobol(2), 2**17) == np.float32(inside(points).mean())


def test_sums_are_compensated():
    """A plain float32 sum over 2**22 points loses three digits of the mean of 1 + a little."""
    mean = qj.integrate(lambda points: np.float32(2.0**24) + points[:, 0], sequences.sobol(1), 2**22)
    assert abs(float(mean) - 2.0**24) <= 2.0


def several(points):
    first = points[:, 0]
    return {"mean": first, "square": (points * points, first < 0.25)}


def test_values_may_be_a_tree_of_any_numbers():
    """Each leaf is what it is alone: floats and counts."""
    n = 999
    found = qj.integrate(several, SEQUENCES["digital"], n)
    assert found["mean"] == qj.integrate(lambda p: p[:, 0], SEQUENCES["digital"], n)
    assert np.array_equal(found["square"][0], qj.integrate(squares, SEQUENCES["digital"], n))
    assert found["square"][1] == qj.integrate(lambda p: p[:, 0] < 0.25, SEQUENCES["digital"], n)
    assert {leaf.dtype for leaf in jax.tree.leaves(found)} == {jnp.dtype("float32")}


REPLICATED = {"owen": sequences.sobol(3), "owen in b": sequences.halton(3), "rotated": sequences.lattice(3)}


@pytest.mark.parametrize("name", few(REPLICATED, "owen"))
def test_replicates_tell_their_error(name):
    """Over 40 keys, errors divided by their standard errors are Student's t with 7 degrees of freedom."""

    def product(points):
        return jnp.prod(1 + (points - 0.5), axis=1)

    ratios = []
    for key in range(40):
        found = qj.integrate(product, REPLICATED[name], 256, replicates=8, key=key, dtype=jnp.float64)
        assert found.replicates == 8
        ratios.append((float(found.integral) - 1) / float(found.standard_error))
    # Of variance 7 / 5 and fourth moment 3 * 49 / (5 * 3).
    assert abs(np.mean(ratios)) < 5 * np.sqrt(7 / 5 / 40)
    assert abs(np.mean(np.square(ratios)) - 7 / 5) < 5 * np.sqrt((9.8 - 1.96) / 40)


def test_replicates_against_scipy():
    """The same estimator as scipy's, of an edge: for smooth functions scipy's scrambling has heavy tails."""
    ours = qj.integrate(inside, sequences.sobol(2), 1024, replicates=16, key=1, dtype=jnp.float64)
    qrng = qmc.Sobol(2, rng=np.random.default_rng(1))
    edge = lambda x: 1.0 * (x.sum(axis=0) < 1)  # noqa: E731
    theirs = qmc_quad(edge, [0, 0], [1, 1], n_estimates=16, n_points=1024, qrng=qrng)
    assert abs(float(ours.integral) - 0.5) < 5 * float(ours.standard_error)
    assert 1 / 3 < float(ours.standard_error) / theirs.standard_error < 3
    ours = qj.integrate(product, sequences.sobol(2), 1024, replicates=16, key=1, dtype=jnp.float64)
    low, high = ours.interval(0.95)  # of means without ties, as counts have
    by_scipy = stats.t.interval(0.95, 15, float(ours.integral), float(ours.standard_error))
    np.testing.assert_allclose((float(low), float(high)), by_scipy, rtol=1e-12)


def test_the_standard_error_is_that_of_the_mean():
    """Of replicates one by one, by the keys that the key is split into."""
    found = qj.integrate(product, sequences.sobol(2), 64, replicates=5, key=1, dtype=jnp.float64)
    copies = [sequences.owen(sequences.sobol(2), key) for key in jax.random.split(jax.random.key(1), 5)]
    points = [np.asarray(copy.points(64, dtype=jnp.float64)) + 2.0**-33 for copy in copies]
    means = [np.prod(each, axis=1).mean() for each in points]
    np.testing.assert_allclose(float(found.integral), np.mean(means), rtol=1e-14)
    np.testing.assert_allclose(float(found.standard_error), stats.sem(means), rtol=1e-10)


def test_replicates_of_trees_by_a_key():
    found = qj.integrate(several, sequences.sobol(2), 128, replicates=4, key=3)
    again = qj.integrate(several, sequences.sobol(2), 128, replicates=4, key=jax.random.key(3))
    assert jax.tree.structure(found.integral) == jax.tree.structure(found.standard_error)
    assert jax.tree.all(jax.tree.map(np.array_equal, found, again))
    other = qj.integrate(several, sequences.sobol(2), 128, replicates=4, key=4)
    assert other.integral["mean"] != found.integral["mean"]
    low, high = found.interval(0.9)
    assert low["mean"] < found.integral["mean"] < high["mean"]


@pytest.mark.parametrize("n", [100, 9000])
def test_closed_over_values_count_all_points(n):
    """Of several dimensions, and of any number of points: the mean and its derivative are those of a sum."""
    sequence = sequences.sobol(2)
    points = np.asarray(sequence.points(n, dtype=np.float64))

    def mean(a):
        return qj.integrate(lambda points: a * points[:, 0] ** 2 + points[:, 1], sequence, n)

    found, slope = jax.jvp(mean, (jnp.float32(2),), (jnp.float32(1),))
    squares = np.mean(points[:, 0] ** 2)
    assert jax.jit(jax.grad(mean))(2.0) == jax.grad(mean)(2.0) == pytest.approx(squares, rel=1e-6)
    np.testing.assert_allclose(found, 2 * squares + points[:, 1].mean(), rtol=1e-6)
    np.testing.assert_allclose(slope, squares, rtol=1e-6)


@pytest.mark.parametrize("start", [77, *slow(0)])
@pytest.mark.parametrize("bad", [np.nan, *slow(np.inf)])
def test_a_value_that_is_not_finite_is_named_with_its_point(bad, start):
    sequence = sequences.sobol(2)
    index = start + 70001
    point = np.asarray(sequence(index))

    def function(points):
        return {"value": jnp.where((points == jnp.asarray(point)[None]).all(axis=1), bad, points[:, 0])}

    message = rf"function must return finite values, .* at point {index}, \({point[0]!s}, {point[1]!s}\)"
    with pytest.raises(ValueError, match=message):
        qj.integrate(function, sequence, 80000, start)
    with pytest.raises(ValueError, match="overflow of 16 values"):
        qj.integrate(lambda points: points[:, 0] + np.float32(3e38), sequence, 16)
    assert not np.isfinite(jax.jit(lambda: qj.integrate(function, sequence, 80000, start)["value"])())


@pytest.mark.slow
@pytest.mark.parametrize("n", [2**31, 2**32])
def test_all_indices_of_32_bits(n):
    """In float32 as well: the points are an equidistant grid whose mean is 1/2 less half a cell."""
    assert qj.integrate(lambda points: points[:, 0], sequences.sobol(1), n) == np.float32(0.5)


def test_the_last_indices():
    """A rest of a block up to index 2**32 - 1, and a number of points that is no int32."""
    sequence, n = sequences.sobol(2), TABULATED + 11
    points = np.asarray(sequence.points(n, 2**32 - n), np.float64)
    measured = qj.integrate(squares, sequence, n, 2**32 - n)
    assert np.allclose(measured, (points**2).mean(axis=0), rtol=3e-7, atol=0)
    shape = jax.eval_shape(lambda: qj.integrate(product, sequence, 2**31 + 5))
    assert shape.dtype == jnp.float32


test_bad_input_is_named = refused(
    (lambda: qj.integrate(product, sequences.hammersley_net(4), 17), "n must be .* got 17"),
    (lambda: qj.integrate(product, sequences.hammersley_net(4), 9, 8), "start .* n must be .* got 8 .* 9"),
    (lambda: qj.integrate(lambda p: jax.lax.complex(p, p), sequences.sobol(1), 4), "of .* got complex64"),
    error=ValueError,
)


@pytest.mark.parametrize("level", [0, 1.0, np.nan, "a", None, True])
def test_levels(level):
    found = qj.integrate(product, sequences.sobol(2), 64, replicates=5, key=1, dtype=jnp.float64)
    with pytest.raises((TypeError, ValueError), match=r"level must be .* got"):
        found.interval(level)
