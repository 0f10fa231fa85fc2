"""Programs are compiled once: for new parameters, keys and numbers of samples, nothing is."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

COMPILED = []
SOBOL, CORPUT = sequences.sobol(2), sequences.van_der_corput()
ALONG = samplers.contiguous(orders.hilbert(20, 20), SOBOL, 16)


def listen(event, seconds, **more):
    if event == "/jax/core/compile/backend_compile_duration":
        COMPILED.append(event)


jax.monitoring.register_event_duration_secs_listener(listen)


def power(exponent, points):
    return points[:, 0] ** exponent


def moment(k, **how):
    return qj.integrate(jax.tree_util.Partial(power, jnp.float32(2 + k)), SOBOL, 10_000, **how)


def square(points):
    return points[:, 0] ** 2


def of_key(key):
    return qj.integrate(square, sequences.owen(SOBOL, key), 10_000)


def disc(k):
    return scenes.disc((0.5, 0.5), jnp.float32(0.2 + 0.1 * k))


def rendered(k):
    return qj.render(disc(k), samplers.independent(SOBOL, k), 8, 8, 8 ** (1 + k))


def passes(k):
    return samplers.randomized(lambda key: samplers.independent(SOBOL, key), k, 4)


# New samples have the same divisors, new points are in as many blocks.
CALLS = {
    "render, a parameter": lambda k: qj.render(scenes.zone_plate(10.0 + k), ALONG, 20, 20, 16),
    "render, key and samples": rendered,
    "render_adaptive": lambda k: qj.render_adaptive(disc(k), ALONG, 20, 20, 16).image,
    "render_passes": lambda k: qj.render_passes(scenes.disc(), passes(k), 8, 8, 2 + k).image,
    "boundary_gradient": lambda k: qj.boundary_gradient(disc(k), CORPUT, 8, 8, 64 + k).radius,
    "integrate, a parameter": moment,
    "integrate, bounds": lambda k: moment(0, bounds=(0, 1 + k)),
    "integrate, a key": of_key,
    "integrate, in a program": partial(
        lambda call, k: call(sequences.owen(SOBOL, k)),
        jax.jit(lambda sequence: qj.integrate(square, sequence, 10_000)),
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_new_numbers_compile_nothing(name):
    first, before = np.asarray(CALLS[name](0)), len(COMPILED)
    for k in (1, 2):
        assert np.any(np.asarray(CALLS[name](k)) != first)
    assert len(COMPILED) == before > 0


class Long:
    """A scene that says that its program takes long to compile, as ray-traced ones do."""

    needs, unrolled = ("x", "y", "time"), 1

    def __init__(self):
        self.traced = []

    def varies(self, low, high):
        return scenes.ball().varies(low, high)

    def __call__(self, point):
        self.traced.append(point.shape)
        return scenes.ball()(point)


@dataclass(frozen=True)
class Far:
    """A user's sampler, with a point outside of the unit cube in one pixel."""

    beyond: int
    dims = 3

    def __call__(self, x, y, sample, dims=(0, 1, 2), dtype=jnp.float32):
        point = jnp.stack([((x * 7 + y * 3 + sample * 5 + j) % 16 / 16).astype(dtype) for j in dims], axis=-1)
        return jnp.where((x + y == self.beyond)[..., None], 1, point)


LONG = [
    (samplers.independent(sequences.sobol(3), 1), 33, 20, 5),
    (samplers.z(64, 64, 8, 2, dims=3), 64, 64, 8),
    (samplers.z(256, 100, 1, 2, dims=3), 256, 100, 1),
    (samplers.progressive(8, 8, 3, dims=3), 8, 8, 300),
    (Far(-1), 7, 5, 9),
]


def test_a_scene_that_takes_long_to_compile_has_one_program():
    """Whatever sampler, size and count; in a program of both, the image has the same bits."""
    scene = Long()
    for dtype in (jnp.float32, jnp.float64):
        for sampler, *how in LONG:
            done = []
            image = qj.render(scene, sampler, *how, dtype=dtype, progress=done.append)
            assert done == sorted(done) and done[-1] == 1 and image.dtype == dtype
            both = jax.jit(partial(qj.render, Long(), sampler, *how, dtype=dtype))()
            np.testing.assert_array_equal(image, both)
    assert scene.traced == 2 * [(2**14, 3)]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LongSlope:
    """One with a parameter."""

    slope: jax.Array
    needs, unrolled = ("x", "y"), 1

    def __call__(self, point):
        return self.slope * point[..., 0]


def test_a_scene_that_takes_long_to_compile_has_derivatives():
    sampler = samplers.contiguous(orders.hilbert(8, 8), SOBOL, 4)
    slope = jax.grad(lambda slope: qj.render(LongSlope(slope), sampler, 8, 8, 4).mean())(jnp.float32(2))
    np.testing.assert_allclose(slope, 0.5, atol=1 / 256)


def test_points_outside_are_found_by_a_program_of_the_scene():
    with pytest.raises(ValueError, match=r"sampler must return points in \[0, 1\), got .* in pixel \(0, 0\)"):
        qj.render(Long(), Far(0), 7, 5, 2)
    wrong = type("Wrong", (Long,), {"__call__": lambda self, point: point[None]})
    with pytest.raises(ValueError, match=r"scene must return values of shape \(...\) or \(..., channels\)"):
        qj.render(wrong(), Far(-1), 7, 5, 2)
