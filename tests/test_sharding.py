"""Images on two devices are those of one, bit by bit."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P
from tables import slow, some

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SIDE, SPP = 8, 4
SOBOL = sequences.sobol(2)


@pytest.fixture(scope="module")
def mesh():
    return jax.make_mesh((2,), ("device",), axis_types=(AxisType.Auto,))


def along(sequence):
    return samplers.contiguous(orders.hilbert(SIDE, SIDE), sequence, SPP)


def image(scene, key):
    return qj.render(scene, along(sequences.owen(SOBOL, key)), SIDE, SIDE, SPP)


def plate(frequency):
    return qj.render(scenes.zone_plate(frequency), along(SOBOL), SIDE, SIDE, SPP)


def gradient(frequency):
    return jax.grad(lambda f: (plate(f) ** 2).sum())(frequency)


SAMPLERS = {
    "independent": lambda key: samplers.independent(SOBOL, key),
    "z": lambda key: samplers.z(SIDE, SIDE, SPP, key),
    "optimized": lambda key: samplers.optimized(SIDE, SIDE, SPP, key),
    "ranked": lambda key: samplers.ranked(2, key),
    "z, tree": lambda key: samplers.z(SIDE, SIDE, SPP, key, "tree"),
    "owen, base b": lambda key: along(sequences.owen(sequences.halton(2), key)),
    "owen_exact, base b": lambda key: along(sequences.owen_exact(sequences.faure(2), key)),
    "passes": lambda key: samplers.randomized(lambda key: along(sequences.owen(SOBOL, key)), key),
}


def check(mesh, function, mapped):
    """Compare two devices with one, eagerly over each device's part and vmapped within it."""
    on_two = jax.jit(
        jax.shard_map(jax.vmap(function), mesh=mesh, in_specs=P("device"), out_specs=P("device"))
    )
    np.testing.assert_array_equal(on_two(mapped), jax.jit(jax.vmap(function))(mapped))


@some("scene", {"smooth": scenes.zone_plate(10.0), "edges": scenes.checkerboard()}, "edges")
def test_keys_over_devices(mesh, scene):
    check(mesh, partial(image, scene), jax.random.split(jax.random.key(1), 4))


@some("make", SAMPLERS, "z")
def test_samplers_over_devices(mesh, make):
    render = lambda key: qj.render(scenes.step(), make(key), SIDE, SIDE, SPP)  # noqa: E731
    check(mesh, render, jax.random.split(jax.random.key(1), 2))


@pytest.mark.parametrize("function", [*slow(plate), gradient])
def test_scenes_over_devices(mesh, function):
    check(mesh, function, jnp.array([10.0, 20.0, 30.0, 40.0], jnp.float32))


def test_rows_over_devices(mesh):
    """Each device makes its rows: a program for the whole image, told where its result is to be."""
    rows = NamedSharding(mesh, P("device"))
    made = jax.jit(plate, out_shardings=rows)(jnp.float32(20))
    assert len(made.sharding.device_set) == 2
    np.testing.assert_array_equal(made, jax.jit(plate)(jnp.float32(20)))


def test_samples_over_devices(mesh):
    """Halves of the samples on two devices, each a pass of a randomised sampler, and their mean."""
    passes = samplers.randomized(lambda key: along(sequences.owen(SOBOL, key)), 1)
    scene = scenes.zone_plate(10.0)
    of_pass = lambda number: qj.render(scene, passes.of_pass(number), SIDE, SIDE, SPP)  # noqa: E731
    numbers = jnp.arange(2, dtype=jnp.uint32)

    def averaged(number):
        return jax.lax.pmean(of_pass(number[0]), "device")

    on_two = jax.jit(jax.shard_map(averaged, mesh=mesh, in_specs=P("device"), out_specs=P()))(numbers)
    first, second = (jax.jit(of_pass)(number) for number in numbers)
    np.testing.assert_array_equal(on_two, (first + second) / 2)


def test_one_parameter_for_all_devices(mesh):
    """The gradient with respect to a parameter that all devices share is the sum of theirs."""
    keys = jax.random.split(jax.random.key(1), 2)

    def total(frequency, keys):
        return jax.vmap(lambda key: image(scenes.zone_plate(frequency), key))(keys).sum()

    def on_two(frequency, keys):
        part = lambda f, k: jax.lax.psum(total(f, k), "device")  # noqa: E731
        return jax.shard_map(part, mesh=mesh, in_specs=(P(), P("device")), out_specs=P())(frequency, keys)

    made, plain = (jax.jit(jax.grad(f))(jnp.float32(20), keys) for f in (on_two, total))
    assert float(made) == pytest.approx(float(plain), rel=1e-5)


@pytest.mark.slow
def test_means_and_edges_over_devices(mesh):
    keys = jax.random.split(jax.random.key(1), 2)
    check(mesh, lambda key: qj.integrate(scenes.zone_plate(3.0), sequences.owen(SOBOL, key), 5000), keys)

    def edges(key):
        sequence = sequences.owen(sequences.van_der_corput(), key)
        return qj.boundary_gradient(scenes.disc(), sequence, SIDE, SIDE, 256).radius

    check(mesh, edges, keys)
