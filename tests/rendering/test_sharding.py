"""Images on two devices are those of one, bit by bit."""

import os
import subprocess
import sys
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables
from jax.sharding import AxisType, Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SIDE, SPP = 8, 4
SOBOL, CORPUT = sequences.sobol(2), sequences.van_der_corput()


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
    "progressive": lambda key: samplers.progressive(SIDE, SIDE, key, dims=4),
    "ranked": lambda key: samplers.ranked(2, key),
    "z, tree": lambda key: samplers.z(SIDE, SIDE, SPP, key, "tree"),
    "owen, base b": lambda key: along(sequences.owen(sequences.halton(2), key)),
    "owen_exact, base b": lambda key: along(sequences.owen_exact(sequences.faure(2), key)),
    "passes": lambda key: samplers.randomized(lambda key: along(sequences.owen(SOBOL, key)), key),
}


def check(mesh, function, mapped):
    """Compare two devices with one, eagerly over each device's part and vmapped within it."""
    # LLVM takes half of the time without optimisation.
    jit = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
    on_two = jit(jax.shard_map(jax.vmap(function), mesh=mesh, in_specs=P("device"), out_specs=P("device")))
    np.testing.assert_array_equal(on_two(mapped), jit(jax.vmap(function))(mapped))


def edges(key):
    return qj.boundary_gradient(scenes.disc(), sequences.owen(CORPUT, key), SIDE, SIDE, 256).radius


FREQUENCIES = jnp.array([10.0, 20.0, 30.0, 40.0], jnp.float32)
OVER_DEVICES = {
    "smooth": (partial(image, scenes.zone_plate(10.0)), 4),
    "edges": (partial(image, scenes.checkerboard()), 4),
    **{
        name: (lambda key, make=make: qj.render(scenes.step(), make(key), SIDE, SIDE, SPP), 2)
        for name, make in SAMPLERS.items()
    },
    "scenes": (plate, FREQUENCIES),
    "gradients": (gradient, FREQUENCIES),
    "mean": (lambda key: qj.integrate(scenes.zone_plate(3.0), sequences.owen(SOBOL, key), 5000), 2),
    "many points": (lambda key: qj.integrate(scenes.zone_plate(3.0), sequences.owen(SOBOL, key), 2**21), 2),
    "boundary gradient": (edges, 2),
}
"""Functions, and what they are mapped over: an array, or so many keys."""


@pytest.mark.slow
@pytest.mark.parametrize("name", OVER_DEVICES)
def test_functions_over_devices(mesh, name):
    function, over = OVER_DEVICES[name]
    check(mesh, function, jax.random.split(jax.random.key(1), over) if isinstance(over, int) else over)


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


@pytest.mark.slow
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


XOR = partial(samplers.independent, SOBOL, randomize="xor")
FRESH = samplers.randomized(lambda key: samplers.z(24, 17, SPP, key), 1)
Z = samplers.z(24, 17, SPP, 1)
LARGE = (24, 17)
SPREAD = {
    "render": partial(qj.render, scenes.checkerboard(), Z, *LARGE, SPP),
    "one pixel": partial(qj.render, scenes.disc(), XOR(1), 1, 1, SPP),
    "render_adaptive": partial(qj.render_adaptive, scenes.disc(), XOR(1), *LARGE, SPP),
    "tolerance": partial(qj.render_adaptive, scenes.disc(), FRESH, *LARGE, 8 * SPP, tolerance=0.05),
    "render_passes": partial(qj.render_passes, scenes.disc(), FRESH, *LARGE, 5, tolerance=0.05),
    "estimated_reference": partial(qj.estimated_reference, scenes.zone_plate(), *LARGE, 64, 1),
    "integrate": partial(qj.integrate, lambda p: {"y": p[:, 1], "2": p**2}, SOBOL, 2**21 + 77),
    "replicates": partial(qj.integrate, jnp.cos, SOBOL, 1000, replicates=3, key=1),
    "boundary_gradient": partial(qj.boundary_gradient, scenes.disc(), CORPUT, *LARGE, 2**13),
    "convergence": lambda mesh: sweep(mesh),
    "pixel_means": partial(analysis.pixel_means, lambda p: p[..., 0] * p[..., 1], Z, *LARGE, SPP),
}


def sweep(mesh):
    """Return the errors of a sweep: four images, which three processes cannot share evenly."""
    compared = {"a": XOR(1), "b": XOR(2)}
    table = analysis.convergence(scenes.disc(), compared, [1, 4], width=24, height=17, repeats=1, mesh=mesh)
    assert [(row.sampler, row.spp) for row in table.rows] == [("a", 1), ("a", 4), ("b", 1), ("b", 4)]
    assert all(row.seconds > 0 for row in table.rows)
    return [tuple(row.errors.values()) for row in table.rows]


def every_derivative(function, mesh):
    """Return those forward, in reverse, and compiled."""
    of, at = partial(function, mesh), jnp.float32(0.3)
    return jax.jacfwd(of)(at), jax.grad(of)(at), compiled_derivative(function, mesh)


def compiled_derivative(function, mesh):
    return jax.jit(jax.grad(partial(function, mesh)))(jnp.float32(0.3))


def bump(x, width):
    """Return a function whose closure holds what derivatives are wanted of."""
    return lambda p: jnp.exp(-width * jnp.sum((p - x) ** 2, axis=-1))


DIFFERENTIATED = {
    "render": lambda mesh, f: sq(qj.render(scenes.zone_plate(60 * f), XOR(1), 150, 133, SPP, mesh=mesh)),
    "integrate": lambda mesh, x: qj.integrate(bump(x, x + 5), SOBOL, 2**21 + 77, mesh=mesh),
    "pixel_means": lambda mesh, x: sq(analysis.pixel_means(bump(x, x + 5), Z, *LARGE, SPP, mesh=mesh)),
}


def sq(values):
    return (values**2).sum()


def check_meshes(make, counts):
    plain = jax.tree.leaves(make(mesh=None))
    for count in counts:
        made = jax.tree.leaves(make(mesh=Mesh(np.array(jax.devices()[-count:]).reshape(-1, 1), ("a", "b"))))
        for one, other in zip(made, plain, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", ["render", "pixel_means"])
def test_a_mesh_changes_no_bit(name):
    check_meshes(SPREAD[name], (1, 2))


@pytest.mark.slow
@pytest.mark.parametrize("make", DIFFERENTIATED.values(), ids=DIFFERENTIATED)
def test_a_mesh_changes_no_bit_of_derivatives(make):
    """Forward, in reverse, and in one program."""
    check_meshes(partial(every_derivative, make), (2,))


def check_others():
    """Three of eight devices cannot share anything evenly."""
    for make in SPREAD.values():
        check_meshes(make, (3,))
    for make in DIFFERENTIATED.values():
        check_meshes(partial(compiled_derivative, make), (8,))


@pytest.mark.slow
def test_a_mesh_of_three_or_eight_changes_no_bit():
    """In a process that has so many: all functions, and derivatives in one program."""
    program = "import test_sharding\ntest_sharding.check_others()"
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_force_host_platform_device_count=8"
    environment = tables.environment(XLA_FLAGS=flags)
    subprocess.run([sys.executable, "-c", program], env=environment, check=True, timeout=300)


@pytest.mark.slow
def test_tiles_of_any_size_change_no_bit(monkeypatch):
    plain = SPREAD["render"](mesh=None)
    for size in (1, 7, 64, 1000):
        tables.sizes(monkeypatch, lanes=size)
        np.testing.assert_array_equal(SPREAD["render"](mesh=None), plain)


def test_a_mesh_is_a_mesh_of_our_devices():
    for wrong in (2, jax.devices(), "cpu"):
        with pytest.raises(TypeError, match=r"mesh must be a jax\.sharding\.Mesh"):
            SPREAD["render"](mesh=wrong)
    strangers = jax.sharding.AbstractMesh((2,), ("device",))
    with pytest.raises(TypeError, match="mesh must be a"):
        SPREAD["integrate"](mesh=strangers)
