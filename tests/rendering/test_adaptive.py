"""Samples that a scene does not need are not taken, and the image is the same."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.ndimage import maximum_filter
from tables import few

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core.pytrees import pytree
from qmcjax.rendering import stopping

SIDE, SPP = 20, 16


@pytree
@dataclass(frozen=True)
class Quadrants:
    """Constant, textured, blinking and both in the quadrants, in three channels."""

    period: jax.Array | float
    needs = ("x", "y", "other", "time")

    def __call__(self, point):
        x, y, time = point[..., 0], point[..., 1], point[..., 3]
        texture = jnp.where(x >= 0.5, jnp.sin(self.period * x) + y, 0.25)
        blinking = jnp.where(y >= 0.5, jnp.floor(2 * time) + time * time, 0.75)
        return jnp.stack([texture, blinking, texture * blinking], axis=-1)

    def varies(self, low, high):
        right, below = high[..., 0] >= 0.5, high[..., 1] >= 0.5
        return jnp.stack([right, right, jnp.zeros_like(right), below], axis=-1)


@pytree
@dataclass(frozen=True)
class Wide:
    """One of forty coordinates matters, on the left."""

    level: float
    needs = ("x", "y", *(f"u{j}" for j in range(2, 40)))

    def __call__(self, point):
        return jnp.where(point[..., 0] < 0.25, point[..., 36], self.level)

    def varies(self, low, high):
        bits = [jnp.zeros(low.shape[:-1], bool)] * 40
        bits[36] = low[..., 0] < 0.25
        return jnp.stack(bits, axis=-1)


def spike(width):
    """Return 1 in a strip of each pixel of an image of 4 x 4, of a width that few samples see."""
    return scenes.function(lambda p: (4 * p[..., 0] % 1 < width).astype(p.dtype), ("x", "y"))


ROOT = lambda p: jnp.sqrt(jnp.where(p[..., 0] > 0.75, 0.15 - p[..., 1] % 0.25, 1.0))  # noqa: E731
NOT_A_NUMBER = scenes.function(ROOT, ("x", "y"))
"""The square root of a difference that is negative in a part of some pixels."""


@pytree
@dataclass(frozen=True)
class Asked:
    """A sampler that writes down which coordinates it is asked for."""

    sampler: samplers.Sampler
    log: ClassVar[list] = []

    @property
    def dims(self):
        return self.sampler.dims

    def __call__(self, x, y, sample, dims=(0, 1), dtype=jnp.float32):
        self.log.append(dims)
        return self.sampler(x, y, sample, dims, dtype)

    def check(self, width, height, spp):
        self.sampler.check(width, height, spp)


def along(side, spp, dims=2):
    return samplers.contiguous(orders.hilbert(side, side), sequences.sobol(dims), spp)


def passes(make=lambda key: samplers.independent(sequences.uniform(2, key), key), spp=4, key=7):
    return samplers.randomized(make, key, spp)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_image_is_the_same_and_counts_are_what_was_taken(dtype):
    scene, sampler = Quadrants(20.0), along(SIDE, SPP, 4)
    whole = qj.render(scene, sampler, SIDE, SIDE, SPP, dtype=dtype)
    result = qj.render_adaptive(scene, sampler, SIDE, SIDE, SPP, dtype=dtype)
    assert result.image.dtype == dtype and result.counts.dtype == np.uint32
    np.testing.assert_allclose(result.image, whole, rtol=0, atol=4 * float(jnp.finfo(dtype).eps))
    np.testing.assert_array_equal(result.counts[10:, :], SPP)
    np.testing.assert_array_equal(result.counts[:, 10:], SPP)
    np.testing.assert_array_equal(result.counts[:9, :9], 1)
    assert result.saving == pytest.approx(1 - result.counts.sum() / (SIDE * SIDE * SPP), abs=1e-12)


@pytest.mark.slow
def test_only_coordinates_that_vary_are_generated():
    Asked.log.clear()
    result = qj.render_adaptive(Quadrants(30.0), Asked(along(SIDE, SPP, 4)), SIDE, SIDE, SPP)
    assert set(Asked.log) == {(0, 1), (3,), (0, 1, 3)}
    assert 0 < result.saving < 0.25


@pytest.mark.slow
def test_more_coordinates_than_bits():
    scene, sampler = Wide(0.5), samplers.independent(sequences.sobol(40), key=1, randomize="xor")
    result = qj.render_adaptive(scene, sampler, 8, 8, SPP)
    np.testing.assert_allclose(result.image, qj.render(scene, sampler, 8, 8, SPP), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(result.counts[:, 3:], 1)
    np.testing.assert_array_equal(result.counts[:, :2], SPP)


def test_passes_go_on_until_the_error_is_small():
    scene, tolerance = scenes.zone_plate(30.0), 0.02
    result = qj.render_adaptive(scene, passes(), SIDE, SIDE, 4096, tolerance=tolerance)
    error = np.asarray(result.image, np.float64) - scene.reference(SIDE, SIDE)[0]
    assert 0.5 * tolerance < np.sqrt(np.mean(error**2)) < tolerance
    assert (result.counts % 4 == 0).all() and 0.5 < result.saving < 1
    assert result.counts.max() > 2 * result.counts.min() >= 32
    limited = qj.render_adaptive(scene, passes(), SIDE, SIDE, 64, tolerance=tolerance)
    assert limited.counts.max() == 64


LEVELS = np.repeat([0.002, 2.0], SIDE // 2)
"""Means of the two halves of an image, left and right."""


def two_levels(point):
    value = jnp.where(point[..., 0] < 0.5, *LEVELS[[0, -1]]) * 2 * point[..., 2]
    return jnp.stack([value, 0.1 * value, 0 * value], axis=-1)


GIVEN = [
    ({"relative": 0.04}, [0.04, 0.04]),
    ({"relative": 0.04, "unbiased": True}, [0.04, 0.04]),
    ({"relative": 0.04, "tolerance": 1.6e-4}, [0.08, 0.04]),
    ({"tolerance": lambda mean, variance: 0.04 * mean.max(axis=-1)}, [0.04, 0.04]),
    ({"tolerance": lambda mean, variance: np.fmax(0.04 * mean[..., :1], 1e-9)}, [0.04, 0.04]),
]


@pytest.mark.parametrize(("given", "parts"), GIVEN)
def test_noise_is_relative_where_asked_for(given, parts):
    """To the brightest channel; with a floor. Neighbours of other levels do not count."""
    scene = scenes.function(two_levels, ("x", "y", "light_u"))
    sampler = passes(lambda key: samplers.independent(sequences.uniform(3, key), key))
    result = qj.render_adaptive(scene, sampler, SIDE, SIDE, 1024, **given)
    errors = (np.asarray(result.image, np.float64)[..., 0] - LEVELS) / LEVELS
    for half, part in enumerate(parts):
        found = np.sqrt(np.mean(errors[:, half * SIDE // 2 : (half + 1) * SIDE // 2] ** 2))
        assert 0.4 * part < found < 1.05 * part
    assert (result.counts.min() == 16) == (parts[0] > parts[1])
    assert result.image[..., 2].max() == 0


@pytest.mark.parametrize("given", [{"relative": 0.02}, {"tolerance": lambda mean, _: 0.02 * mean + 1e-9}])
def test_passes_end_at_a_relative_error(given):
    """The root mean square over all values of the errors over the allowed ones, by hand; zeros have none."""
    scene = scenes.function(two_levels, ("x", "y", "light_u"))
    sampler = passes(lambda key: samplers.independent(sequences.uniform(3, key), key))
    found = qj.render_passes(scene, sampler, SIDE, SIDE, 1000, **given)
    before = qj.render_passes(scene, sampler, SIDE, SIDE, found.passes - 1)
    misses = []
    for made in (before, found):
        mean, variance = np.float64(made.image), np.float64(made.variance)
        scale = np.broadcast_to(mean[..., :1] if "relative" in given else mean + 1e-9, mean.shape)
        misses.append(np.sqrt(np.mean(variance / np.square(0.02 * scale))))
    assert misses[1] < 1 < misses[0]


@pytest.mark.slow
@pytest.mark.parametrize("unbiased", [True, False])
def test_unbiased_when_asked_for(unbiased):
    """Four passes of four samples in nine pixels see no spike with probability (1 - width)^144, 0.56."""
    scene, images = spike(0.004), []
    for key in range(30):
        result = qj.render_adaptive(scene, passes(key=key), 4, 4, 1024, tolerance=0.004, unbiased=unbiased)
        images.append(np.asarray(result.image, np.float64).mean())
        assert result.counts.min() >= (20 if unbiased else 16)
        assert result.counts.max() <= 1024
    deviation = np.mean(images) - 0.004
    sigma = np.std(images, ddof=1) / np.sqrt(len(images))
    assert (abs(deviation) < 5 * sigma) == unbiased


@pytest.mark.slow
def test_constant_pixels_take_no_passes():
    scene = Quadrants(20.0)
    sampler = passes(lambda key: samplers.independent(sequences.uniform(4, key), key))
    result = qj.render_adaptive(scene, sampler, SIDE, SIDE, 32, tolerance=1e-9)
    assert (result.counts[:9, :9] == 1).all()
    assert (result.counts[10:, 10:] == 32).all()
    np.testing.assert_array_equal(result.image[:9, :9], [[[0.25, 0.75, 0.1875]] * 9] * 9)


@pytest.mark.parametrize("more", [{}, {"tolerance": 0.1}, {"tolerance": 0.1, "unbiased": True}])
def test_progress_is_reported_and_ends(more):
    for scene in (scenes.zone_plate(10.0), scenes.disc((5.0, 5.0), 0.1)):
        seen: list[float] = []
        qj.render_adaptive(scene, passes(), SIDE, SIDE, 64, progress=seen.append, **more)
        assert seen == sorted(seen) and seen[0] > 0 and seen[-1] == 1
        if "tolerance" in more:
            np.testing.assert_allclose(seen[:-1], seen[0] * np.arange(1, len(seen)), err_msg="pass by pass")


ONE = samplers.contiguous(orders.raster(4, 4), sequences.halton(2), 4)
FOUND = r"\(3, 0\), sample 2, point \[0.859375, 0.2037"
NOT_FINITE = {
    "adaptive": (partial(qj.render_adaptive, NOT_A_NUMBER, ONE, 4, 4, 4), FOUND),
    "render": (partial(qj.render, NOT_A_NUMBER, ONE, 4, 4, 4), FOUND),
    "passes": (partial(qj.render_adaptive, NOT_A_NUMBER, passes(), 4, 4, 64, tolerance=0.01), r"\(3, "),
    # The pilot is not part of the image, and its values count, too.
    "unbiased": (
        partial(qj.render_adaptive, NOT_A_NUMBER, passes(), 4, 4, 64, tolerance=0.01, unbiased=True),
        r"\(3, ",
    ),
}


@pytest.mark.parametrize("name", few(NOT_FINITE, "adaptive"))
def test_values_that_are_not_finite_are_found_and_named(name):
    """Points 12, 13, 14 and 15 have 4, 13, 22 and 7 27ths of the height: 22/27 / 4 is above 0.15."""
    call, place = NOT_FINITE[name]
    with pytest.raises(ValueError, match=f"scene must return finite values, got nan in pixel {place}"):
        call()


test_bad_input_is_named = refused(
    (TypeError, along(4, 4), 4, {"tolerance": 0.1}, "samplers.randomized .* got .*Contiguous"),
    (TypeError, passes(), 16, {"tolerance": np.ones(2)}, "tolerance must be one number"),
    (TypeError, passes(), 16, {"relative": np.ones(2)}, "relative must be one number"),
    (passes(), 16, {"relative": -0.1}, "relative must be .*positive.* got -0.1"),
    (passes(), 64, {"tolerance": lambda m, v: -m}, "tolerance must return positive numbers, got an array"),
    (passes(), 64, {"tolerance": lambda m, v: np.ones(3)}, r"of shape \(4, 4\) or \(4, 4\), got an array"),
    (passes(), 18, {"tolerance": 0.1}, "multiple of the 4 samples .* got 18"),
    (passes(), 12, {"tolerance": 0.1}, "at least 16 .* got 12"),
    (passes(), 16, {"tolerance": 0.1, "unbiased": True}, "at least 20 .* got 16"),
    (along(4, 4), 4, {"unbiased": True}, "unbiased must be False without"),
    call=lambda sampler, spp, more: qj.render_adaptive(scenes.zone_plate(10.0), sampler, 4, 4, spp, **more),
    error=ValueError,
)


TRANSFORMED = [lambda total: jax.grad(total)(10.0), lambda total: jax.vmap(total)(jnp.ones(2))]


@pytest.mark.parametrize("transformed", [*TRANSFORMED, lambda total: jax.jit(lambda: total(10.0))()])
def test_not_for_transformations(transformed):
    """Inside jit also a scene whose parameters are known."""

    def total(frequency):
        return qj.render_adaptive(scenes.zone_plate(frequency), along(4, 4), 4, 4, 4).image.sum()

    with pytest.raises(TypeError, match=r"render_adaptive decides on values.* got a tracer"):
        transformed(total)


def varying(bits):
    class Wrong:
        needs = ("x", "y")

        def __call__(self, point):
            return point[..., 0]

        def varies(self, low, high):
            return bits(low)

    return qj.render_adaptive(Wrong(), along(4, 4), 4, 4, 4)


WANTED = r"bool of shape \(4, 4, 2\), got "
test_what_varies_must_be_told_for_each_coordinate = refused(
    (lambda low: jnp.ones((*low.shape[:-1], 3), bool), WANTED + r"bool of \(4, 4, 3\)"),
    (lambda low: jnp.ones(low.shape, jnp.int32), WANTED + "int32"),
    call=varying,
    error=ValueError,
)


def test_passes_stop_by_the_unbiased_variance():
    """Passes of one pixel by hand: with squares divided by n instead of n - 1 they would stop at four."""
    sampler, scene = passes(key=3), scenes.zone_plate(30.0)
    values = [float(qj.render(scene, sampler.of_pass(k), 1, 1, 4)[0, 0]) for k in range(16)]
    errors = {n: np.std(values[:n], ddof=1) / np.sqrt(n) for n in range(4, 17)}
    tolerance = 0.93 * errors[4]
    assert np.std(values[:4]) / 2 < tolerance
    wanted = next(n for n, error in errors.items() if error <= tolerance)
    result = qj.render_adaptive(scene, sampler, 1, 1, 64, tolerance=tolerance)
    assert int(result.counts[0, 0]) == 4 * wanted > 16
    assert float(result.image[0, 0]) == pytest.approx(np.mean(values[:wanted]), abs=1e-6)


@pytest.mark.slow
def test_passes_of_pixels_by_hand():
    """Each stops for good where the error of it, its neighbours and all channels is small.

    With ``unbiased`` four passes of their own tell how many there are, and are none of the image's.
    """

    def colours(point):
        x, y = point[..., 0], point[..., 1]
        return jnp.stack([jnp.sin(40 * x * x), jnp.where(y > 0.7, x, 0), jnp.cos(9 * y) ** 9], axis=-1)

    scene, sampler, (width, height), limit = scenes.function(colours, ("x", "y")), passes(key=5), (7, 5), 16
    pilot = replace(sampler, key=jax.random.fold_in(sampler.key, stopping._PILOT_KEY))
    values, before = (
        np.stack([np.float64(qj.render(scene, of.of_pass(k), width, height, 4)) for k in range(count)])
        for of, count in ((sampler, limit), (pilot, 4))
    )

    def squared_errors(given):
        of_passes = np.array([[np.max(np.var(v, axis=0, ddof=1)) for v in row] for row in given])
        return maximum_filter(of_passes, 3, mode="constant")

    def first(counts):
        """Return the first passes of each pixel."""
        return [[values[: counts[y, x], y, x] for x in range(width)] for y in range(height)]

    tolerance = np.sqrt(np.median(squared_errors(first(np.full((height, width), 4)))) / 12)
    taken, active = np.full((height, width), 4), np.ones((height, width), bool)
    for _ in range(4, limit):
        active &= squared_errors(first(taken)) > tolerance**2 * taken
        taken += active
    wanted = np.ceil(squared_errors(np.moveaxis(before, 0, 2)) / tolerance**2)
    wanted = np.clip(wanted, 1, limit - 4).astype(int)
    for counts, more in ((taken, 0), (wanted, 4)):
        assert len(np.unique(counts)) > 2, counts
        found = qj.render_adaptive(
            scene, sampler, width, height, 4 * limit, tolerance=tolerance, unbiased=more > 0
        )
        assert np.array_equal(found.counts, 4 * (counts + more))
        means = [[v.mean(axis=0) for v in row] for row in first(counts)]
        np.testing.assert_allclose(found.image, means, atol=1e-6)


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_boxes_hold_their_pixels_though_edges_are_rounded(dtype):
    """In exact arithmetic; 49 times the rounded 1/49 is below 1."""
    seen = []

    class Recorded:
        needs = ("x", "y", "time")

        def __call__(self, point):
            return point[..., 0]

        def varies(self, low, high):
            jax.debug.callback(lambda *box: seen.append(box), low, high)
            return jnp.zeros(low.shape, bool)

    width, height = 49, 41
    sampler = samplers.independent(sequences.sobol(3), key=1)
    qj.render_adaptive(Recorded(), sampler, width, height, 4, dtype=dtype)
    jax.effects_barrier()
    low, high = map(np.asarray, seen[0])
    assert low.dtype == dtype
    for axis, size in ((0, width), (1, height)):
        for k in range(size):
            edges = [box[:, k, axis] if axis == 0 else box[k, :, axis] for box in (low, high)]
            assert all(Fraction(float(edge)) <= Fraction(k, size) for edge in edges[0])
            assert all(Fraction(float(edge)) >= Fraction(k + 1, size) for edge in edges[1])
            assert (edges[1] - edges[0]).max() * size < 1 + 16 * size * jnp.finfo(dtype).eps
    assert (low[..., 2] == 0).all() and (high[..., 2] == 1).all()
