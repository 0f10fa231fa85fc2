"""Scenes with exact answers rendered with and without skipping: the same image from fewer samples."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import mixed
from test_programs import Long

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.rendering import _accumulation

pytestmark = pytest.mark.usefixtures("least_optimized")

SPP = 10
NAMES = """checkerboard flat_checkerboard disc step triangle line staircase moving_edge blinking_disc ball
    defocused_edge soft_shadow"""
SCENES = {name: getattr(scenes, name)() for name in NAMES.split()}
QUICK = {("disc", 64), ("defocused_edge", 37)}
"""Each scene compiles for a second or more: the others are slow tests."""
TWICE = ("checkerboard", "disc", "step")
"""Scenes with images of both sizes: in the larger one, edges lie between pixels."""


def along(width, height, dims):
    sequence = sequences.owen(sequences.sobol(dims), key=1)
    return samplers.contiguous(orders.hilbert(width, height), sequence, SPP)


def apart(width, height, dims):
    return samplers.independent(sequences.sobol(dims), key=1)


def doubtful(scene, width, height):
    """Return how many constant pixels may be sampled: their edges touch the scene's, all but exactly.

    A corner here and there; on the checkerboard the last row, the rows at y = 1/2 and 1/4 and the columns at
    x = 1/2, on both sides, where these are between pixels.
    """
    corners = (width + height) // 6
    if not isinstance(scene, scenes.Checkerboard):
        return corners
    rows, columns = 1 + 2 * (height % 2 == 0) + 2 * (height % 4 == 0), 2 * (width % 2 == 0)
    return corners + width * rows + height * columns


def cases():
    for width, height in ((37, 23), (64, 64)):
        for name in SCENES if width == 37 else TWICE:
            marks = [] if (name, width) in QUICK else pytest.mark.slow
            yield pytest.param(name, width, height, along, marks=marks)
    yield pytest.param("soft_shadow", 50, 31, apart, marks=pytest.mark.slow)


@pytest.mark.parametrize(("name", "width", "height", "make"), [*cases()])
def test_the_image_is_the_same_from_fewer_samples(name, width, height, make):
    """To 4 units of rounding; one sample where the exact mean tells of a constant, but for a few pixels."""
    scene = SCENES[name]
    sampler = make(width, height, len(scene.needs))
    whole = np.asarray(qj.render(scene, sampler, width, height, SPP), np.float64)
    result = qj.render_adaptive(scene, sampler, width, height, SPP)
    image, eps = np.asarray(result.image, np.float64), float(np.finfo(np.float32).eps)
    assert abs(image - whole).max() <= 4 * eps

    exact, bound = scene.reference(width, height)
    constant = ~mixed(scene, exact, bound)
    assert set(np.unique(result.counts)) == {1, SPP}
    assert (result.counts[~constant] == SPP).all()
    wasted = np.count_nonzero(result.counts[constant] == SPP)
    assert wasted <= doubtful(scene, width, height) <= 0.7 * constant.sum()
    # The wasted samples are all that is between the saving and what the exact means promise.
    promised = (np.count_nonzero(constant) - wasted) * (SPP - 1) / (width * height * SPP)
    assert result.saving == pytest.approx(promised, abs=1e-12)

    assert abs(image - exact)[constant].max() <= bound + eps
    with_, without = (np.sqrt(np.mean((made - exact) ** 2)) for made in (image, whole))
    assert with_ <= without + 4 * eps


def integer_operations(scene):
    """Return the operations on integers of the program of an image, in order: those that make points."""
    width, height, dims = 8, 8, tuple(range(len(scene.needs)))
    sampler = along(width, height, 4)
    state = _accumulation.zeros(scene, (1, width * height), jnp.float32)
    none = jnp.uint32(0)
    how = _accumulation.How(width * height, width, height, 2, 1, False, dims, np.dtype(np.float32), None)
    lowered = _accumulation.accumulate.lower((scene, sampler), none[None], state, none, none, how)
    lines = [re.sub(r"[%@]\w+(#\d)?", "%", line).strip() for line in lowered.as_text().splitlines()]
    return [line for line in lines if "ui32" in line and line.startswith("% =") and "while" not in line]


@pytest.mark.parametrize(
    ("still", "plain", "moving"),
    [
        (scenes.moving_edge(0.3, None), scenes.step(0.0, 0.3), scenes.moving_edge(0.3, 0.0)),
        (scenes.blinking_disc(on=None), scenes.disc(), scenes.blinking_disc()),
        (scenes.ball([[0.5, 0.5]], None, ()), scenes.disc(), scenes.ball([[0.5, 0.5]], [[0.5, 0.5]], ())),
        (scenes.defocused_edge(0.0, 0.3, None), scenes.step(0.0, 0.3), scenes.defocused_edge(0.0, 0.3, 0.1)),
        (scenes.soft_shadow(light=None), scenes.step(), scenes.soft_shadow()),
    ],
    ids=lambda scene: type(scene).__name__,
)
def test_what_stands_still_pays_nothing(still, plain, moving):
    """No operation generates time, lens or light, though the sampler has them; some do otherwise."""
    operations = integer_operations(plain)
    assert len(operations) > 100
    assert integer_operations(still) == operations
    more = integer_operations(moving)
    assert len(more) >= len(operations) + 20 * (len(moving.needs) - 2)


@pytest.mark.slow
def test_a_long_program_is_compiled_once_for_what_varies():
    """Whatever coordinates matter, for however many pixels: one size of calls. The image is the same."""
    scene, sampler = Long(), along(64, 64, 3)
    result = qj.render_adaptive(scene, sampler, 64, 64, SPP)
    # For the type of its values, at the centres, and for the samples.
    assert {np.prod(shape[:-1]) for shape in scene.traced} == {64 * 64, 1024}
    other = qj.render_adaptive(scenes.ball(), sampler, 64, 64, SPP)
    np.testing.assert_allclose(result.image, other.image, atol=4 * float(np.finfo(np.float32).eps))
    np.testing.assert_array_equal(result.counts, other.counts)
