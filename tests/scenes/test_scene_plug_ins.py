"""Scenes of users: objects without a decorator, pytrees and functions, everywhere that scenes go."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import some

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SIDE, SPP = 8, 4


class HalfPlane:
    """A scene without a decorator or base class, and all that a scene may have."""

    needs = ("x", "y")

    def __init__(self, offset=0.4):
        self.offset = offset

    def __call__(self, point):
        return (point[..., 0] < self.offset).astype(point.dtype)

    def varies(self, low, high):
        met = (low[..., 0] <= self.offset) & (high[..., 0] >= self.offset)
        return jnp.stack([met, jnp.zeros_like(met)], axis=-1)

    def reference(self, width, height):
        return scenes.step(0.0, self.offset).reference(width, height)


def half_plane(offset, point):
    return (point[..., 0] < offset).astype(point.dtype)


SCENES = {
    "object": HalfPlane(),
    "function": scenes.function(lambda point: half_plane(0.4, point), ("x", "y")),
    "Partial": scenes.function(jax.tree_util.Partial(half_plane, jnp.float32(0.4)), ["x", "y"]),
}
SAMPLER = samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.sobol(2), SPP)
PASSES = samplers.randomized(lambda key: samplers.independent(sequences.sobol(2), key), 1, SPP)
IMAGE = qj.render(scenes.step(0.0, 0.4), SAMPLER, SIDE, SIDE, SPP)


@some("scene", SCENES, "object")
def test_a_scene_is_any_object_with_needs_and_a_call(scene):
    np.testing.assert_array_equal(qj.render(scene, SAMPLER, SIDE, SIDE, SPP), IMAGE)
    adaptive = qj.render_adaptive(scene, SAMPLER, SIDE, SIDE, SPP)
    np.testing.assert_array_equal(adaptive.image, IMAGE)
    assert (adaptive.saving > 0.5) == isinstance(scene, HalfPlane)
    passes = qj.render_passes(scene, PASSES, SIDE, SIDE, 2)
    assert passes.image.shape == (SIDE, SIDE)


def test_the_same_object_compiles_once():
    calls = []

    class Counted(HalfPlane):
        def __call__(self, point):
            calls.append(1)
            return super().__call__(point)

    scene = Counted()
    qj.render(scene, SAMPLER, SIDE, SIDE, SPP)
    once = len(calls)
    qj.render(scene, SAMPLER, SIDE, SIDE, SPP)
    assert len(calls) == once
    np.testing.assert_array_equal(qj.render(Counted(0.0), SAMPLER, SIDE, SIDE, SPP), jnp.zeros((SIDE, SIDE)))


OF = [lambda k: jax.tree_util.Partial(lambda a, p: a * p[..., 0], k), lambda k: lambda p: k * p[..., 0]]


@pytest.mark.parametrize("of", OF, ids=["parameter", "closed over"])
def test_functions_have_derivatives_of_what_they_are_made_of(of):
    """Also of what they close over, where every call compiles anew."""

    def total(level):
        return qj.render(scenes.function(of(level), ("x", "y")), SAMPLER, SIDE, SIDE, SPP).sum()

    assert float(jax.grad(total)(jnp.float32(3))) == pytest.approx(float(total(jnp.float32(1))), rel=1e-6)


@dataclass(frozen=True, eq=False)
class WithArray:
    levels: np.ndarray
    needs = ("x", "y")

    def __call__(self, point):
        return point[..., 0]


test_what_is_no_scene_is_named = refused(
    (WithArray(np.ones(3)), "scene must be a pytree .* WithArray with the array 'levels'"),
    (HalfPlane, "scene must be a scene .* got <class"),
    (scenes.disc, "scene must be a scene .* got <function disc"),
    ((scenes.disc(),), r"scene must be a scene .* got "),
    call=lambda scene: qj.render(scene, SAMPLER, SIDE, SIDE, SPP),
    error=TypeError,
)


NEEDS = [(TypeError, (1, 2), r"needs must be a tuple of names .* got \(1, 2\)")]
NEEDS += [(ValueError, ("x",), r"needs must name the two dimensions .* got \('x',\)")]


@pytest.mark.parametrize("error, needs, message", NEEDS)
def test_needs_are_checked(error, needs, message):
    with pytest.raises(error, match=message):
        scenes.function(lambda p: p[..., 0], needs)
    scene = HalfPlane()
    scene.needs = needs
    with pytest.raises(error, match=message):
        qj.render(scene, SAMPLER, SIDE, SIDE, SPP)


def test_a_function_shows_its_name():
    assert repr(scenes.function(jnp.sum, ("x", "y"))) == "function(sum, needs=('x', 'y'))"
    assert "HalfPlane object" in repr(scenes.as_scene("scene", HalfPlane()))
