"""Programs with arguments of this library, written by ``jax.export`` and read again."""

import subprocess
import sys
from dataclasses import dataclass, field
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import EVERY
from tables import BY_DEFAULT, ORDERS, SAMPLERS, SEQUENCES, Table, environment, first, pixels, some

from qmcjax import orders, pytree, samplers, scenes, sequences, tracing

export = pytest.importorskip("jax.export")
pytest.importorskip("flatbuffers")
pytestmark = pytest.mark.usefixtures("least_optimized")

CURVES = Table({f"order, {name}": partial(make, 8, 8) for name, make in ORDERS.items()})
SCENES = Table({f"scene, {name}": partial(EVERY.__getitem__, name) for name in EVERY})
TRACED = Table(
    {
        f"traced, {name}": make
        for name, make in {
            "cornell_box": scenes.cornell_box,
            "helicopter": scenes.helicopter,
            "path_tracing": lambda: tracing.path_tracing(*world(), bounces=2),
            "resampled_light": lambda: tracing.resampled_light(*world(), candidates=4),
            "analytic": lambda: tracing.analytic_visibility(tracing.direct_light(*world())),
        }.items()
    }
)
# A sampler that holds a function of the user.
OBJECTS = SEQUENCES | SAMPLERS.without(["randomized, contiguous, owen"]) | CURVES | SCENES | TRACED


def world():
    ball = tracing.sphere([0, 0, 0], 1.0)
    return tracing.world([ball], [tracing.point_light([4, 4, 4], 50.0)]), tracing.camera([0, 0, 5], [0, 0, 0])


def results(value):
    """Return some of what an object makes."""
    if hasattr(value, "position"):
        return value.position(*pixels(4, 4)[:2])
    if hasattr(value, "needs"):
        return value(jnp.full((2, len(value.needs)), 0.4, jnp.float32))
    return value(first(16)) if hasattr(value, "size") else value(*pixels(4, 4, 2))


def again(function, *args):
    """Return a function that was written and read."""
    return export.deserialize(export.export(jax.jit(function))(*args).serialize())


@some("value", OBJECTS, *BY_DEFAULT["sequences"], *BY_DEFAULT["samplers"], "scene, ramp", "traced, analytic")
def test_structures_are_written_and_read(value):
    found = again(lambda value: jax.tree.leaves(value), value)
    assert found.in_tree == jax.tree.structure(((value,), {}))
    for leaf, same in zip(jax.tree.leaves(value), found.call(value), strict=True):
        if not jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            assert np.array_equal(leaf, same) or np.allclose(leaf, same, rtol=1e-7)


# Numba's search, where it is there, cannot be exported.
FEWER = ("owen(sobol(2))", "order, hilbert", "z, tree", "scene, disc")


@some("value", OBJECTS.without(["traced, helicopter"]), *FEWER)
def test_programs_are_written_and_read(value):
    assert np.array_equal(again(results, value).call(value), jax.jit(results)(value))


@some("value", OBJECTS, *BY_DEFAULT["sequences"], *BY_DEFAULT["samplers"], "scene, ramp", "traced, analytic")
def test_paths_name_the_attributes(value):
    for path, leaf in jax.tree.leaves_with_path(value):
        found = value
        for key in path:
            at_attribute = isinstance(key, jax.tree_util.GetAttrKey)
            found = getattr(found, key.name) if at_attribute else found[getattr(key, "idx", None)]
        assert found is leaf


def test_users_functions_may_become_part_of_the_program():
    made = SAMPLERS["randomized, contiguous, owen"]
    found = again(lambda *where: made(*where), *pixels(4, 4, 2))
    assert np.array_equal(found.call(*pixels(4, 4, 2)), results(made))


def test_names_are_public():
    """What a file holds does not name a private module."""
    text = export.export(jax.jit(lambda s: s.f.seeds))(sequences.owen(sequences.sobol(2), 1)).serialize()
    assert b"qmcjax.sequences.OwenHash" in text and b"_scrambling" not in text


def test_other_keys_are_the_same_program():
    found = again(results, SAMPLERS["independent, owen"])
    other = samplers.independent(sequences.sobol(2), key=9)
    assert np.array_equal(found.call(other), jax.jit(results)(other))
    with pytest.raises(ValueError, match=r"tree structure|pytree"):
        found.call(samplers.ranked(2, 1))


def test_derivatives_are_written_on_request():
    exported = export.export(jax.jit(lambda scene, point: scene(point)))(scenes.gaussian(), jnp.full(2, 0.4))
    found = export.deserialize(exported.serialize(vjp_order=1))
    for function in (found.call, exported.call):
        gradient = jax.grad(lambda p, f=function: f(scenes.gaussian(), p))(jnp.full(2, 0.4))
        expected = jax.grad(lambda p: scenes.gaussian()(p))(jnp.full(2, 0.4))
        assert np.allclose(gradient, expected, rtol=1e-6) and np.any(expected != 0)


@pytree
@dataclass(frozen=True)
class Choices:
    x: jax.Array
    choice: object = field(metadata={"static": True})


@pytest.mark.parametrize(
    "choice",
    [None, True, 1, 2**70, -0.0, 1e-300, float("inf"), "a\u00e9", (), ((1, "b"), (2.5, None)), samplers.z],
)
def test_choices_are_written_and_read(choice):
    given = Choices(jnp.zeros(2), choice)
    (found,), _ = again(lambda value: value.x, given).in_tree.unflatten([0])
    assert repr(found.choice) == repr(choice) and type(found.choice) is type(choice)


@pytest.mark.parametrize("choice", [lambda: 1, test_names_are_public, orders, 1j, (1, pytest), jnp.sin])
def test_what_cannot_be_written_is_named(choice):
    with pytest.raises(TypeError, match="Choices cannot be serialized: static fields must contain numbers"):
        again(lambda value: value.x, Choices(jnp.zeros(2), choice))


def test_functions_and_objects_of_users_are_named():
    for value in (
        SAMPLERS["randomized, contiguous, owen"],
        samplers.function(lambda x, y, sample: jnp.zeros((*x.shape, 2)), 2),
        scenes.function(lambda point: point[..., 0], ("x", "y")),
    ):
        with pytest.raises(TypeError, match=r"qmcjax\.\w+.* cannot be serialized: static fields .*function"):
            again(lambda value: 0, value)


def test_a_name_is_for_one_class():
    def defined():
        @pytree
        @dataclass(frozen=True)
        class Twice:
            x: jax.Array

        return Twice(jnp.zeros(2))

    value = defined()
    assert again(lambda value: value.x, value).call(value).tolist() == [0, 0]
    with pytest.raises(TypeError, match="Twice cannot be serialized: there are several classes of this name"):
        again(lambda value: value.x, defined())


@pytest.mark.slow
def test_another_process_reads_it(tmp_path):
    sampler = samplers.z(8, 8, 4, 3, "tree", sequence=sequences.owen(sequences.sobol(3), key=3))
    file = tmp_path / "program"
    program = jax.jit(lambda s, x, y, k: s(x, y, k))
    file.write_bytes(export.export(program)(sampler, *pixels(8, 8, 4)).serialize())
    program = f"""
import jax, numpy as np
from jax import export
from qmcjax import samplers, sequences
from tables import pixels
sampler = samplers.z(8, 8, 4, 3, "tree", sequence=sequences.owen(sequences.sobol(3), key=3))
program = export.deserialize(bytearray(open({str(file)!r}, "rb").read()))
np.save({str(tmp_path / "points.npy")!r}, program.call(sampler, *pixels(8, 8, 4)))
"""
    subprocess.run([sys.executable, "-c", program], check=True, env=environment())
    assert np.array_equal(np.load(tmp_path / "points.npy"), sampler(*pixels(8, 8, 4)))
