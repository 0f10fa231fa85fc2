"""What is not what an argument is named for is refused with a TypeError that names it and tells what came."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SCENE, SOBOL = scenes.disc(), sequences.sobol(2)
SAMPLER = samplers.contiguous(orders.hilbert(4, 4), SOBOL, 4)
PASSES = samplers.randomized(lambda key: samplers.independent(SOBOL, key), 1, 4)

FUNCTIONS = {
    "render": (qj.render, {"scene": SCENE, "sampler": SAMPLER, "width": 4, "height": 4, "spp": 4}),
    "render_adaptive": (
        qj.render_adaptive,
        {"scene": SCENE, "sampler": PASSES, "width": 4, "height": 4, "spp": 16, "tolerance": 0.5},
    ),
    "render_passes": (
        qj.render_passes,
        {"scene": SCENE, "sampler": PASSES, "width": 4, "height": 4, "passes": 2, "tolerance": 0.5},
    ),
    "render_layers": (
        qj.render_layers,
        {"moving": SCENE, "still": SCENE, "sampler": SAMPLER, "width": 4, "height": 4, "spp": 4}
        | {"still_spp": 4, "shade": 1.0},
    ),
    "estimated_reference": (
        qj.estimated_reference,
        {"scene": SCENE, "width": 4, "height": 4, "spp": 16, "key": 1},
    ),
    "boundary_gradient": (
        qj.boundary_gradient,
        {"scene": SCENE, "sequence": sequences.sobol(1), "width": 4, "height": 4, "n": 16},
    ),
    "checkerboard": (scenes.checkerboard, {"squares": 8.0}),
    "flat_checkerboard": (scenes.flat_checkerboard, {"squares": 8.0, "angle": 0.1}),
    "zone_plate": (scenes.zone_plate, {"frequency": 8.0}),
    "step": (scenes.step, {"angle": 0.1, "offset": 0.5}),
    "staircase": (scenes.staircase, {"angle": 0.1, "offsets": [0.5]}),
    "line": (scenes.line, {"angle": 0.1, "offset": 0.5, "thickness": 0.1}),
    "disc": (scenes.disc, {"centre": (0.5, 0.5), "radius": 0.1}),
    "triangle": (scenes.triangle, {"vertices": [[0, 0], [1, 0], [0, 1]]}),
    "heaviside": (scenes.heaviside, {"dims": 3, "threshold": 1.0}),
    "product": (scenes.product, {"a": [1.0, 2.0]}),
    "genz": (scenes.genz, {"family": "gaussian", "dims": 2, "difficulty": 1.0, "shift": 0.5}),
    "path_toy": (scenes.path_toy, {"bounces": 2, "albedo": 0.5, "survival": 0.5, "emission": 1.0}),
    "ramp": (scenes.ramp, {"dimension": 2}),
    "gaussian": (scenes.gaussian, {"centre": (0.5, 0.5), "width": 0.1}),
    "moving_edge": (scenes.moving_edge, {"offset": 0.5, "velocity": 0.1}),
    "blinking_disc": (scenes.blinking_disc, {"centre": (0.5, 0.5), "radius": 0.1, "on": (0.1, 0.4)}),
    "ball": (
        scenes.ball,
        {"starts": [[0.5, 0.5]], "ends": [[0.5, 0.6]], "times": (), "radius": 0.1},
    ),
    "defocused_edge": (
        scenes.defocused_edge,
        {"angle": 0.1, "offset": 0.5, "blur": 0.1, "aperture": "disc"},
    ),
    "soft_shadow": (scenes.soft_shadow, {"angle": 0.1, "offset": 0.5, "height": 0.4, "light": (0.1, 0.2)}),
    "function": (scenes.function, {"f": lambda p: p[..., 0], "needs": ("x", "y")}),
    "reference": (SCENE.reference, {"width": 4, "height": 4}),
}
WRONG = {
    "text": "text",
    "object": object(),
    "class": int,
    "complex": 1j,
    "bool": True,
    "dict": {"a": 1},
    "texts": ["a", "b"],
    "ragged": [[1.0], [2.0, 3.0]],
    "sequence": SOBOL,
}
FITS = {
    ("render_adaptive", "spp", "bool"),
    ("genz", "family", "text"),
    ("defocused_edge", "aperture", "text"),
    ("function", "needs", "texts"),
    ("boundary_gradient", "sequence", "sequence"),
    *(("function", "f", value) for value in ("sequence",)),
}
CASES = [
    (name, argument, wrong)
    for name, (_, arguments) in FUNCTIONS.items()
    for argument in arguments
    for wrong in WRONG
    if (name, argument, wrong) not in FITS
]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_right_arguments_are_taken(name):
    function, arguments = FUNCTIONS[name]
    function(**arguments)


@pytest.mark.parametrize(("name", "argument", "wrong"), CASES)
def test_wrong_types_are_named(name, argument, wrong):
    function, arguments = FUNCTIONS[name]
    with pytest.raises(TypeError, match=rf"^{argument}(\.\w+)? must .*got ") as caught:
        function(**(arguments | {argument: WRONG[wrong]}))
    assert len(str(caught.value)) < 400


RENDERS = [
    n for n in FUNCTIONS if n.startswith("render") or n in ("estimated_reference", "boundary_gradient")
]


@pytest.mark.parametrize("name", RENDERS)
@pytest.mark.parametrize(
    ("error", "dtype"),
    [(TypeError, "no dtype"), (TypeError, 1), (ValueError, jnp.float16), (ValueError, int)],
)
def test_dtypes_are_checked(name, error, dtype):
    function, arguments = FUNCTIONS[name]
    with pytest.raises(error, match="dtype must be float32 or float64, got "):
        function(**arguments, dtype=dtype)


@pytest.mark.parametrize("name", ["render", "render_adaptive"])
def test_progress_must_be_a_function_outside_of_jit(name):
    function, arguments = FUNCTIONS[name]
    with pytest.raises(TypeError, match="progress must be a function of the finished part, got 3"):
        function(**arguments, progress=3)
    call = partial(function, **arguments, progress=print)
    with pytest.raises(TypeError, match=r"jax\.jit"):
        jax.jit(lambda: call())()


def test_nouns_in_each_others_places():
    with pytest.raises(TypeError, match=r"scene must be a scene .* got "):
        qj.render(SAMPLER, SCENE, 4, 4, 4)
    with pytest.raises(TypeError, match=r"sampler must be a sampler .* got "):
        qj.render(SCENE, SCENE, 4, 4, 4)
    with pytest.raises(TypeError, match=r"sequence must be a sequence .* got "):
        qj.boundary_gradient(SCENE, SAMPLER, 4, 4, 4)  # pyright: ignore[reportArgumentType]


def test_numbers_of_any_kind_are_taken():
    image = qj.render(SCENE, SAMPLER, np.int64(4), np.uint8(4), jnp.uint32(4), dtype="float32")
    np.testing.assert_array_equal(image, qj.render(SCENE, SAMPLER, 4, 4, 4))
