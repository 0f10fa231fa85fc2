"""Samplers of users: objects without decorators, functions, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

ORDER, SEQUENCE = orders.hilbert(8, 8), sequences.sobol(3)


def owen_pass(key):
    return samplers.contiguous(ORDER, sequences.owen(SEQUENCE, key), 2)


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8, int])
def test_any_integers_are_pixels_and_samples(kind):
    sampler = owen_pass(1)
    assert np.array_equal(
        sampler(kind(3), kind(5), kind(1)), sampler(np.uint32(3), np.uint32(5), np.uint32(1))
    )
    assert sampler([1, 2], 0, np.arange(2)).shape == (2, 3)


def centred(x, y, sample, dims):
    return (
        jnp.stack([(x + y + sample + np.uint32(j)) % np.uint32(8) for j in dims], axis=-1).astype(np.float32)
        / 8
    )


class Plain:
    """A call without dtype, no decorator, no check."""

    dims = 3

    def __call__(self, x, y, sample, dims):
        return centred(x, y, sample, dims)


class WithDtype(Plain):
    def __call__(self, x, y, sample, dims, dtype):
        return centred(x, y, sample, dims).astype(dtype)


class Prepared:
    """The two methods of a loop, and a check."""

    dims = 3

    def prepare(self, x, y, dims):
        return {"sum": x + y}

    def points(self, state, sample, dims, dtype):
        return centred(state["sum"], np.uint32(0), sample, dims).astype(dtype)

    def check(self, width, height, spp):
        if spp > 4:
            raise ValueError(f"spp must be at most 4, got {spp}")


OWN = {
    "call": Plain(),
    "dtype": WithDtype(),
    "methods": Prepared(),
    "function": samplers.function(lambda x, y, s: centred(x, y, s, (0, 1, 2)), 3),
}


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("dtype", [jnp.float32, pytest.param(jnp.float64, marks=pytest.mark.slow)])
def test_any_object_with_the_protocol_is_a_sampler(name, dtype):
    sampler = samplers.as_sampler("sampler", OWN[name])
    x, y, sample = (np.arange(6) * k for k in (1, 2, 3))
    expected = (x + y + sample)[:, None] + np.array([2, 0])
    with jax.enable_x64(True):
        for call in (sampler, jax.jit(sampler, static_argnames=("dims", "dtype"))):
            points = call(
                x.astype(np.uint32), y.astype(np.uint32), sample.astype(np.uint32), dims=(2, 0), dtype=dtype
            )
            assert points.dtype == dtype
            assert np.array_equal(points, expected % 8 / 8)
    scene = scenes.checkerboard()
    image = qj.render(scene, OWN[name], 4, 4, 4)
    assert np.array_equal(
        image, qj.render(scene, samplers.function(lambda x, y, s: centred(x, y, s, (0, 1)), 2), 4, 4, 4)
    )


def test_the_check_of_a_user_is_asked():
    with pytest.raises(ValueError, match="spp must be at most 4, got 5"):
        qj.render(scenes.checkerboard(), Prepared(), 4, 4, 5)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            lambda self, x, y, sample, dims: centred(x, y, sample, (0,)),
            r"sampler must return points of shape \(5, 2\) .* got float32 \(5, 1\)",
        ),
        (lambda self, x, y, sample, dims: x, r"sampler must return floats, got an array of uint32 \(5,\)"),
        (lambda self, x, y, sample, dims: None, "sampler must return floats, got None"),
        (
            lambda self, x, y, sample, dims, dtype: centred(x, y, sample, dims)[0],
            r"sampler must return .* got float32 \(2,\)",
        ),
        (
            lambda self, x, y, sample, dims, dtype: x,
            r"sampler must return .* dtype float32 .* got uint32 \(5,\)",
        ),
    ],
)
def test_points_of_a_user_are_checked_while_tracing(points, message):
    class Own:
        dims = 2
        __call__ = points

    with pytest.raises(ValueError, match=message):
        jax.jit(samplers.as_sampler("sampler", Own()))(np.arange(5, dtype=np.uint32), 0, 0)


def test_values_of_a_function_are_rounded_below_one():
    with jax.enable_x64(True):
        top = samplers.function(lambda x, y, s: jnp.full((*x.shape, 1), 1 - 2.0**-40, jnp.float64), 1)
        assert float(top(0, 0, 0, (0,))[0]) == 1 - 2.0**-24


def test_arrays_of_an_undecorated_object_are_refused():
    """A program would go on with the values of the time when it was compiled."""
    own = Plain()
    own.table = np.zeros(3)
    with pytest.raises(TypeError, match="sampler must be a pytree to have an array as attribute, got Plain"):
        samplers.as_sampler("sampler", own)
