"""Wrong objects in every public function of samplers and orders, and objects of users in all places."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

ORDER, SEQUENCE = orders.hilbert(8, 8), sequences.sobol(3)


def owen_pass(key):
    return samplers.contiguous(ORDER, sequences.owen(SEQUENCE, key), 2)


# What each function is called with; each of these arguments is replaced by what is none.
CALLS = {
    "contiguous": (samplers.contiguous, {"order": ORDER, "sequence": SEQUENCE, "spp": 4}),
    "segments": (
        lambda order, sequence, spp: samplers.segments(order, sequence, spp, doubling=True),
        {"order": ORDER, "sequence": SEQUENCE, "spp": 4},
    ),
    "partitioned": (samplers.partitioned, {"order": ORDER, "sequence": SEQUENCE, "component": 0}),
    "shifted": (samplers.shifted, {"order": ORDER, "shifts": SEQUENCE, "sequence": SEQUENCE}),
    "independent": (samplers.independent, {"sequence": SEQUENCE, "key": 1, "randomize": "owen"}),
    "independent, shift": (
        lambda sequence: samplers.independent(sequence, 1, "shift"),
        {"sequence": SEQUENCE},
    ),
    "dither": (samplers.dither, {"mask": np.zeros((2, 2)), "sequence": SEQUENCE}),
    "blue_noise_mask": (samplers.blue_noise_mask, {"channels": 1}),
    "ranked": (samplers.ranked, {"dims": 2, "key": 1}),
    "interleaved": (
        samplers.interleaved,
        {"sequence": SEQUENCE, "spp": 4, "tile": 2, "positions": samplers.ranked(2, 1)},
    ),
    "full_screen": (samplers.full_screen, {"net": sequences.hammersley_net(6), "width": 8, "height": 8}),
    "padded_replications": (
        samplers.padded_replications,
        {"net": sequences.hammersley_net(6), "width": 8, "height": 8, "offsets": 1},
    ),
    "optimized": (samplers.optimized, {"width": 8, "height": 8, "spp": 4, "key": 1, "dims": 2}),
    "z": (samplers.z, {"width": 8, "height": 8, "spp": 4, "key": 1, "variant": "hash"}),
    "z, dims": (lambda dims: samplers.z(8, 8, 4, 1, dims=dims), {"dims": 2}),
    "z, constituents": (
        lambda constituents: samplers.z(8, 8, 4, 1, constituents=constituents),
        {"constituents": (2,)},
    ),
    "z, sequence": (lambda sequence: samplers.z(8, 8, 4, 1, sequence=sequence), {"sequence": SEQUENCE}),
    "z, rounds": (samplers.z(8, 8, 4, 1).extended, {"rounds": 2}),
    "z, counts": (samplers.z(8, 8, 4, 1).adaptive, {"counts": np.ones((8, 8), int)}),
    "randomized": (samplers.randomized, {"sampler_of_key": owen_pass, "key": 1, "spp": 2}),
    "function": (samplers.function, {"f": lambda x, y, s: jnp.zeros((*x.shape, 2)), "dims": 2}),
    "as_sampler": (
        lambda sampler: samplers.as_sampler("sampler", sampler),
        {"sampler": samplers.ranked(2, 1)},
    ),
    "as_order": (lambda order: orders.as_order("order", order), {"order": ORDER}),
    "permutation": (orders.permutation, {"image": [[1, 0]]}),
    "raster": (orders.raster, {"width": 8, "height": 8}),
    "peano": (orders.peano, {"width": 8, "height": 8}),
    "scrambled_morton": (orders.scrambled_morton, {"width": 8, "height": 8, "key": 1, "variant": "hash"}),
    "position": (ORDER.position, {"x": 1, "y": 1}),
    "pixel": (ORDER.pixel, {"position": 1}),
    "optimized order": (orders.optimized, {"width": 8, "height": 8, "spp": 4, "key": 1}),
    "scrambled": (orders.scrambled_morton(8, 8, 1).scrambled, {"code": 1, "digits": 2}),
    "a sampler": (samplers.ranked(2, 1), {"x": 1, "y": 1, "sample": 1, "dims": (0,), "dtype": "float32"}),
    "check": (samplers.ranked(2, 1).check, {"width": 8, "height": 8, "spp": 4}),
}

WRONG = {
    "object": object(),
    "size": (512, 512),
    "word": "halton",
    "fraction": 0.5,
    "engine": qmc.Sobol(2),
    "class": samplers.Sampler,
    "sequence": sequences.halton(2),
    "order": orders.morton(8, 8),
    "sampler": samplers.ranked(3, 2),
    "scene": scenes.checkerboard(),
    "array": np.full((3, 3), np.nan),
    "complex": np.array([1j]),
    "bool": True,
    "None": None,
    "list": [[1, 2], [3]],
    "function": len,
}


@pytest.mark.parametrize("name", CALLS)
def test_the_right_arguments_are_taken(name):
    function, arguments = CALLS[name]
    function(**arguments)


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("name", CALLS)
def test_wrong_arguments_are_named(name, wrong):
    """Each is refused by a message that begins with its name, unless it happens to be right."""
    function, arguments = CALLS[name]
    for argument in arguments:
        if argument == "sampler_of_key" and wrong == "function":
            continue  # What it raises is its own.
        try:
            made = function(**(arguments | {argument: WRONG[wrong]}))
        except (TypeError, ValueError) as error:
            assert re.search(rf"\b{argument}\b", str(error).split(":")[0]), str(error)
            assert len(str(error)) < 500 and "\n" not in str(error)
        else:
            assert taken(argument, WRONG[wrong]), (argument, made)


def taken(argument, value):
    """Tell whether what was made for another place serves in this one."""
    if argument in ("x", "y", "sample") and value == WRONG["size"]:
        return True  # Integers.
    if value is None:
        return argument in ("component", "positions", "dims", "constituents", "sequence", "spp")
    kinds = {
        "order": orders.Order,
        "sampler": samplers.Sampler,
        "positions": samplers.Sampler,
        "sequence": sequences.Sequence,
        "shifts": sequences.Sequence,
        "offsets": sequences.Sequence,
        "net": sequences.RadicalInverses,
    }
    return isinstance(value, kinds.get(argument, ())) or (argument == "f" and callable(value))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: samplers.contiguous((512, 512), SEQUENCE, 4),
            TypeError,
            r"order must be an order \(width, height, length and position\(x, y\)\), got \(512, 512\)",
        ),
        (lambda: samplers.contiguous(ORDER, ORDER, 4), TypeError, "sequence must be a sequence .* got"),
        (
            lambda: samplers.as_sampler("sampler", SEQUENCE),
            TypeError,
            r"sampler must be a sampler \(dims, and either a call on \(x, y, sample, dims\[, dtype\]\) or",
        ),
        (lambda: samplers.independent(SEQUENCE, None), TypeError, "key must be one .* got None"),
        (lambda: owen_pass(1)(0, 0, 2), ValueError, r"sample must be integers in \[0, 1\], got 2"),
        (lambda: owen_pass(1)(8, 0, 0), ValueError, r"x must be integers in \[0, 7\], got 8"),
        (lambda: owen_pass(1)(0, 0.5, 0), TypeError, r"y must be integers .* got 0.5"),
        (lambda: owen_pass(1).check(8, 8, 2.0), TypeError, r"spp must be an integer .* got 2.0"),
        (lambda: owen_pass(1).check(0, 8, 2), ValueError, r"width must be an integer in \[1, 65536\], got 0"),
    ],
)
def test_messages_say_what_is_wanted_and_what_came(call, error, message):
    with pytest.raises(error, match=message):
        call()


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8, int])
def test_any_integers_are_pixels_and_samples(kind):
    sampler = owen_pass(1)
    assert np.array_equal(
        sampler(kind(3), kind(5), kind(1)), sampler(np.uint32(3), np.uint32(5), np.uint32(1))
    )
    assert sampler([1, 2], 0, np.arange(2)).shape == (2, 2)


# -- objects of users


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
