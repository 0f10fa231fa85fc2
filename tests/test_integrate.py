"""The mean of a function over a sequence, against the points themselves in float64."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import first, some

import qmcjax as qj
from qmcjax import scenes, sequences

TABULATED = 8 * 4096
SEQUENCES = {
    "digital": sequences.sobol(3),
    "many coordinates": sequences.sobol(9),
    "scrambled": sequences.owen(sequences.digital_shift(sequences.sobol(3), key=1), key=2),
    "base b": sequences.halton(3),
    "lattice": sequences.lattice(3),
}


def squares(points):
    return points * points


def inside(points):
    return points[:, 0] + points[:, 1] < 1


def product(points):
    return points[:, 0] * points[:, 1]


@pytest.mark.parametrize(
    "n, start", [pytest.param(1, 7, marks=pytest.mark.slow), (2 * TABULATED + 99, 3 * 4096)]
)
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


def test_parameters_have_gradients_and_compile_nothing():
    traces = []

    def power(exponent, points):
        traces.append(1)
        return points[:, 0] ** exponent

    def mean(exponent):
        return qj.integrate(function=jax.tree_util.Partial(power, exponent), sequence=sequence, n=n)

    sequence, n = sequences.sobol(1), TABULATED + 100
    value, slope = jax.value_and_grad(mean)(jnp.float32(2.0))
    assert abs(value - 1 / 3) < 1e-4
    assert abs(slope + 1 / 9) < 1e-4  # d/da of 1 / (a + 1)
    mean(jnp.float32(2.0))
    counted = len(traces)
    mean(jnp.float32(3.0))
    assert len(traces) <= counted + 1  # the check of the shape


def test_jit_and_a_new_start_and_key_compile_nothing():
    traces = []

    @jax.jit
    def mean(sequence):
        traces.append(1)
        return qj.integrate(product, sequence, TABULATED)

    keyed = [sequences.owen(sequences.sobol(2), key) for key in (1, 2)]
    means = [mean(sequence) for sequence in keyed]
    assert len(traces) == 1
    assert means[0] != means[1]
    assert means[0] == qj.integrate(product, keyed[0], TABULATED)


def test_a_scene_is_a_function():
    scene = scenes.zone_plate()
    points = sequences.sobol(2)(first(10000))
    values = jax.jit(lambda scene, points: scene(points))(scene, points)
    measured = qj.integrate(scene, sequences.sobol(2), 10000)
    assert np.isclose(measured, np.asarray(values, np.float64).mean(), rtol=1e-5)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: qj.integrate(product, sequences.sobol(2), 0), "n must be .* got 0"),
        (lambda: qj.integrate(product, sequences.hammersley_net(4), 17), "n must be .* got 17"),
        (
            lambda: qj.integrate(product, sequences.hammersley_net(4), 9, 8),
            "start .* n must be .* got 8 .* 9",
        ),
        (lambda: qj.integrate(jnp.sum, sequences.sobol(2), 9), "function must return values"),
        (lambda: qj.integrate(product, sequences.sobol(2), 9, dtype=jnp.float16), "dtype must be .*float16"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
