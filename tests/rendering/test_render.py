"""The way from scene and sampler to image."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables
from refusals import refused
from tables import SAMPLERS, SIDE, SPP, first, slow, slow_cases, some

import qmcjax as qj
from figures.shared.costs import peak_of
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.rendering import _task


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Plane:
    """A plug-in scene, linear in the pixel and in time, in three channels."""

    slope: jax.Array
    needs = ("x", "y", "time")

    def __call__(self, point):
        x, y, time = point[..., 0], point[..., 1], point[..., 2]
        return jnp.stack([self.slope * x, y, time], axis=-1)


PLANE = Plane(jnp.float32(0.5))


# LLVM takes half of the time without optimisation, and few points are evaluated.
jit = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
draw = jit(lambda sampler, *where, dims: sampler(*where, dims), static_argnames="dims")
evaluate = jit(lambda scene, points: scene(points))


def brute_force(scene, sampler, width, height, spp):
    """Return the mean over the samples, in float64, point by point as in the design."""
    y, x, sample = np.meshgrid(first(height), first(width), first(spp), indexing="ij")
    x, y, sample = (jnp.asarray(a) for a in (x, y, sample))
    drawn = np.array(draw(sampler, x, y, sample, dims=tuple(range(len(scene.needs)))), np.float32)
    drawn[..., 0] = (np.asarray(x) + drawn[..., 0]) * np.float32(1 / width)
    drawn[..., 1] = (np.asarray(y) + drawn[..., 1]) * np.float32(1 / height)
    return np.asarray(evaluate(scene, drawn), np.float64).mean(axis=2)


@some("sampler", SAMPLERS, "full_screen, permutation", "shifted, hilbert, lattice", "z, hash")
def test_image_is_the_mean_of_the_samples(sampler):
    scene = qj.scenes.zone_plate(10.0)
    image = qj.render(scene, sampler, SIDE, SIDE, SPP)
    assert image.shape == (SIDE, SIDE) and image.dtype == jnp.float32
    np.testing.assert_allclose(image, brute_force(scene, sampler, SIDE, SIDE, SPP), rtol=0, atol=2e-6)


SIZES = [(20, 9, 6), (1, 7, 3), *slow_cases((32, 32, 16), (20, 9, 1), (1, 7, 4))]


@pytest.mark.parametrize("width, height, spp", SIZES)
def test_colours_more_dimensions_and_any_size_and_count(width, height, spp):
    sampler = samplers.contiguous(orders.hilbert(width, height), sequences.halton(5), spp)
    image = qj.render(PLANE, sampler, width, height, spp)
    assert image.shape == (height, width, 3)
    np.testing.assert_allclose(image, brute_force(PLANE, sampler, width, height, spp), rtol=0, atol=1e-6)


def test_sums_are_compensated():
    """2**17 additions of 0.1: plain float32 sums lose four digits."""
    spp = 2**17
    tenth = scenes.function(lambda point: jnp.full(point.shape[:-1], 0.1, point.dtype), ("x", "y"))
    sampler = samplers.independent(sequences.sobol(2), key=0)
    image = np.asarray(qj.render(tenth, sampler, 2, 1, spp))
    np.testing.assert_array_max_ulp(image, np.full((1, 2), 0.1, np.float32), maxulp=1)
    naive = np.float32(0)
    for term in np.full(spp, 0.1, np.float32):
        naive += term
    assert abs(naive / spp - 0.1) > 1e-5


def test_progress_and_the_split_into_calls_do_not_change_the_image(monkeypatch):
    scene, sampler, parts = qj.scenes.zone_plate(), samplers.independent(sequences.sobol(2), key=0), []
    whole = qj.render(scene, sampler, 16, 16, 48)
    tables.sizes(monkeypatch, samples=16 * 16 * 32)
    split = qj.render(scene, sampler, 16, 16, 48, progress=parts.append)
    assert parts == [32 / 48, 1.0], "the second call has half as many samples"
    assert np.array_equal(whole, split)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class LastCorner:
    """A plug-in sampler without a base class: the largest offset there is."""

    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return jnp.full((*x.shape, len(dims)), 1 - jnp.finfo(dtype).epsneg, dtype)

    def check(self, width, height, spp):
        pass


@pytest.mark.parametrize("width", [3, 65536, *slow(1, 512)])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_points_stay_in_the_half_open_square(width, dtype):
    """The last pixel plus its largest offset rounds up to the width, which would be 1."""
    outside = scenes.function(lambda p: jnp.any((p < 0) | (p >= 1), axis=-1).astype(p.dtype), ("x", "y"))
    assert not np.any(qj.render(outside, LastCorner(), width, 1, 1, dtype=dtype))


def in_float64(values):
    sampler = samplers.contiguous(orders.hilbert(4, 4), sequences.sobol(2), 4)
    return qj.render(scenes.function(values, ("x", "y")), sampler, 4, 4, 4, dtype=jnp.float64)


test_values_have_the_dtype_and_shape_of_the_points = refused(
    (lambda p: p[..., 0].astype(jnp.float32), r"float64, got \(16,\) and float32"),
    (lambda p: p[..., 0] < 0.5, r"float64, got \(16,\) and bool"),
    (lambda p: p[0, 0], r"got \(\) and float64"),
    (lambda p: p[..., None], r"got \(16, 2, 1\) and float64"),
    call=in_float64,
    error=ValueError,
)


@pytest.mark.slow
def test_gradient_does_not_depend_on_the_split_into_calls(monkeypatch):
    sampler = samplers.independent(sequences.sobol(2), key=0)
    slope = jax.grad(lambda f: (qj.render(qj.scenes.zone_plate(f), sampler, 16, 16, 48) ** 2).sum())
    whole = slope(jnp.float32(20))
    tables.sizes(monkeypatch, samples=16 * 16 * 16)
    assert float(slope(jnp.float32(20))) == pytest.approx(float(whole), rel=1e-5)


SAMPLER = SAMPLERS["contiguous, hilbert, sobol"]
SCENE, OF_A_NET = qj.scenes.zone_plate(), samplers.independent(sequences.hammersley_net(3), 0)
POLE = qj.scenes.function(lambda p: 1 / abs(jnp.floor(32 * p[..., 1]) - 5), ("x", "y"))
test_bad_values_are_named = refused(
    (lambda: qj.render(SCENE, SAMPLER, 32, 32, 5), "spp must be at most 4 .* got 5"),
    (lambda: qj.render(SCENE, SAMPLER, 16, 16, 4), "must be the sampler's 32 x 32, got 16 x 16"),
    (lambda: qj.render(SCENE, SAMPLERS["full_screen, hammersley"], 32, 32, 2), "spp must be 4, .* got 2"),
    (lambda: qj.render(SCENE, SAMPLERS["full_screen, hammersley"], 32, 16, 4), "32 x 32, got 32 x 16"),
    (lambda: qj.render(PLANE, SAMPLER, 32, 32, 4), r"the 3 dimensions .* got 2: \('time',\) are missing"),
    (lambda: qj.render(POLE, SAMPLER, 32, 32, 4), r"finite values, got inf in pixel \(0, 5\), sample 0"),
    (lambda: qj.render(SCENE, OF_A_NET, 4, 4, 9), "spp must be at most 8 for this sequence, got 9"),
    error=ValueError,
)


def test_the_first_value_that_is_not_finite_is_named(monkeypatch):
    """By column, row and number, in an image that is no square; searched for in a few samples at a time."""
    monkeypatch.setattr(_task, "_SEARCHED", 2)

    def in_order(x, y, sample):
        return jnp.stack([jnp.full(sample.shape, 0.5), (sample.astype(jnp.float32) + 0.5) / 8], axis=-1)

    def value(point):
        late = (jnp.floor(5 * point[..., 0]) == 3) & (jnp.floor(24 * point[..., 1]) >= 8 + 5)
        return jnp.where(late, jnp.nan, 1.0).astype(point.dtype)

    scene = qj.scenes.function(value, ("x", "y"))
    with pytest.raises(ValueError, match=r"finite values, got nan in pixel \(3, 1\), sample 5, point"):
        qj.render(scene, samplers.function(in_order, 2), 5, 3, 8)


@pytest.mark.slow
def test_a_large_image_is_kept_once(monkeypatch):
    """However many parts it is made of."""
    tables.sizes(monkeypatch, samples=2**16)
    sampler = samplers.z(4096, 4096, 1, 1)

    def make(scene):
        return qj.render(scene, sampler, 4096, 4096, 1)

    image = make(scenes.disc())
    size = image.nbytes
    del image  # its program is compiled
    peak = peak_of(make, scenes.disc())
    assert peak is None or peak < 1.5 * size


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_each_frame_is_the_mean_of_the_last_images(count):
    """To the last bit, however many came before."""
    rng = np.random.default_rng(count)
    images = rng.normal(size=(9, 3, 4)).astype(np.float32) * 10.0 ** rng.integers(-6, 7, size=(9, 1, 1))
    frames = list(qj.sliding_means(images.astype(np.float32), count))
    wide = images.astype(np.float32).astype(np.float64)
    windows = [sum(wide[k + 1 : k + count], wide[k]) / count for k in range(10 - count)]
    np.testing.assert_array_equal(frames, windows)
    alone = [next(qj.sliding_means(wide[k : k + count], count)) for k in range(10 - count)]
    np.testing.assert_array_equal(frames, alone)


def test_images_are_asked_for_one_by_one_and_frames_are_their_own():
    """What callers write to images afterwards, and to frames, leaves those to come alone."""
    image, asked = np.zeros((2, 2)), []

    def images():
        for k in range(100):
            asked.append(k)
            image[:] = k
            yield image

    frames = qj.sliding_means(images(), 4)
    for last in (3, 4, 5):
        frame = next(frames)
        assert np.all(frame == last - 1.5) and asked == list(range(last + 1))
        frame[:] = 0
    assert list(qj.sliding_means([image], 2)) == []


def test_the_oldest_image_is_added_first():
    """The last 1 is not lost in what was added before."""
    images = [[a] for a in (5.0, 1e16, 1.0, -1e16, 1.0)]
    assert [frame.tolist() for frame in qj.sliding_means(images, 4)][1] == [1 / 4]


test_mistakes = refused(
    (3, 1, TypeError, "images must be an iterable of images, got 3"),
    ([np.ones(2), np.ones(3)], 2, r"images must have the same shape \(2,\), got \(3,\)"),
    ([np.ones((2, 3)), np.ones((3, 2))], 2, r"have the same shape \(2, 3\), got \(3, 2\)"),
    (tuple("ab"), 2, TypeError, "images must be made of real numbers, got 'a'"),
    call=lambda images, count: list(qj.sliding_means(images, count)),
    error=ValueError,
)
