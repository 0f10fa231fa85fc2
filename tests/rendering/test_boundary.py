"""Derivatives of pixel means by sampled edges, and their closed forms."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy.special import ndtr
from tables import few

from qmcjax import scenes, sequences
from qmcjax.core.pytrees import pytree
from qmcjax.rendering._boundary import boundary_gradient
from qmcjax.scenes._edges import spread

WIDTH, HEIGHT = 16, 12
# None of these has an edge along or through the border of pixels, where means have kinks.
SCENES = {
    "step": scenes.step(0.41, 0.61),
    "step upwards": scenes.step(-2.1, -0.3),
    "step outside": scenes.step(0.4, 2.5),
    "staircase": scenes.staircase(0.41, [0.9, 0.3, 0.63, 1.7]),
    "line": scenes.line(1.21, 0.61, 0.05),
    "disc": scenes.disc((0.451, 0.562), 0.307),
    "cut disc": scenes.disc((1.03, 0.2), 0.41),
    "disc around": scenes.disc((0.5, 0.5), 0.81),
    "triangle": scenes.triangle([(0.151, 0.207), (0.913, 0.404), (0.355, 0.857)]),
    "turned triangle": scenes.triangle([(0.151, 0.207), (0.355, 0.857), (0.913, 0.404)]),
    "cut triangle": scenes.triangle([(1.21, 0.41), (0.153, -0.2), (0.353, 0.87)]),
    "flat board": scenes.flat_checkerboard(8.1, 0.31),
    "flat board, few": scenes.flat_checkerboard(0.93, -2.0),
    "heaviside(2)": scenes.heaviside(2, 0.931),
    "heaviside(4)": scenes.heaviside(4, 1.7),
}
NAMES = pytest.mark.parametrize("name", SCENES)


def elements(scene):
    """Yield (leaf, index) of all real numbers of a scene."""
    for i, leaf in enumerate(jax.tree.leaves(scene)):
        yield from ((i, index) for index in np.ndindex(np.shape(leaf)))


def moved(scene, i, index, by):
    leaves, tree = jax.tree.flatten(scene)
    leaves = [np.array(leaf, np.float64) for leaf in leaves]
    leaves[i][index] += by
    return tree.unflatten(leaves)


def flat(gradient):
    """Return all gradients side by side, shape (height, width, numbers)."""
    parts = [np.reshape(leaf, (*leaf.shape[:2], -1)) for leaf in jax.tree.leaves(gradient)]
    return np.concatenate(parts, axis=-1).astype(np.float64)


def sequence(name, key):
    """Return a randomised sequence on the edges."""
    return sequences.digital_shift(sequences.sobol(len(SCENES[name].needs) - 1), key=key)


@NAMES
@pytest.mark.parametrize(("width", "height"), [(WIDTH, HEIGHT), (1, 1), (64, 7)])
def test_closed_forms_are_central_differences(name, width, height):
    """To 1e-6 of the largest, the derivatives of exact means."""
    scene = SCENES[name]
    gradient, bound = scene.reference_gradient(width, height)
    assert jax.tree.structure(gradient) == jax.tree.structure(scene)
    assert bound <= 1e-10 * width * height
    step = 2e-6
    for (i, index), image in zip(elements(scene), np.moveaxis(flat(gradient), -1, 0), strict=True):
        assert image.shape == (height, width)
        after, before = (moved(scene, i, index, by).reference(width, height)[0] for by in (step, -step))
        difference = (after - before) / (2 * step)
        assert abs(difference - image).max() <= 1e-6 * max(1, abs(image).max()) + bound


def test_bounds_of_edges_that_graze_borders():
    """Which pixels does an edge sweep that all but lies on a border? The bound says that it is open."""
    _, clear = scenes.step(1e-10, 0.3).reference_gradient(2, 2)
    _, grazing = scenes.step(1e-10, 0.5).reference_gradient(2, 2)
    assert clear < 1e-13 < 1e-6 < grazing
    _, clear = scenes.disc((0.5, 0.5), 0.3).reference_gradient(2, 2)
    _, grazing = scenes.disc((0.5, 0.5), 0.25).reference_gradient(4, 4)
    assert clear < 1e-13 < 1e-7 < grazing
    gradient, bound = scenes.step(3e-8, 0.5).reference_gradient(2, 1)
    # x < 1/2 / cos(angle) - y tan(angle), and 1 / cos(angle) is 1 + angle**2 / 2: all but y < 1e-8 is left.
    np.testing.assert_allclose(gradient.offset, [[2, 0]], atol=bound + 1e-7)


def estimates(name, n, keys, kind=sequence):
    """Return the gradients by randomised points, shape (keys, height, width, numbers)."""
    made = [boundary_gradient(SCENES[name], kind(name, key), WIDTH, HEIGHT, n) for key in range(keys)]
    return np.stack([flat(gradient) for gradient in made])


# Each kind of scene compiles for a second.
QUICK = ["staircase", "disc", "cut disc", "turned triangle", "cut triangle", "flat board", "heaviside(4)"]


@pytest.mark.parametrize("name", few(SCENES, *QUICK))
def test_the_estimate_is_the_closed_form(name):
    """Within 5 sigma of the mean over 64 keys, for every pixel and parameter, and typically within one."""
    scene, keys, n = SCENES[name], 64, 2**10
    gradient = boundary_gradient(scene, sequence(name, 0), WIDTH, HEIGHT, n)
    assert jax.tree.structure(gradient) == jax.tree.structure(scene)
    for image, leaf in zip(jax.tree.leaves(gradient), jax.tree.leaves(scene), strict=True):
        assert image.shape == (HEIGHT, WIDTH, *np.shape(leaf)) and image.dtype == jnp.float32
    samples = estimates(name, n, keys)
    exact = flat(scene.reference_gradient(WIDTH, HEIGHT)[0])
    sigma = samples.std(axis=0, ddof=1) / np.sqrt(keys)
    off = abs(samples.mean(axis=0) - exact)
    one_point = 2 * WIDTH * HEIGHT / (n * keys)
    # Where all keys agree, another number of points in a pixel may be as probable as chance leaves unseen.
    unseen = 1 - (2 * ndtr(-5)) ** (1 / keys)
    assert np.all(off <= 5 * sigma + np.where(sigma > one_point / 10, one_point, unseen * keys * one_point))
    hit = sigma > one_point / 10
    assert hit.any() == exact.any()
    assert not hit.any() or 0.6 < np.sqrt(np.mean((off[hit] / sigma[hit]) ** 2)) < 1.6


@pytest.mark.slow
def test_low_discrepancy_beats_random():
    """By 10 and more at 2**14 samples; 16 times as many lower the error to 1/16, random ones to 1/4."""
    exact = flat(SCENES["disc"].reference_gradient(WIDTH, HEIGHT)[0])
    random, scrambled = (
        [np.sqrt(np.mean((estimates("disc", n, 16, kind) - exact) ** 2)) for n in (2**10, 2**14)]
        for kind in (lambda name, key: sequences.uniform(1, key=key), sequence)
    )
    assert random[1] >= 20 * scrambled[1] and 3.4 < random[0] / random[1] < 4.6
    assert 11 < scrambled[0] / scrambled[1] < 23


@pytest.mark.parametrize("name", ["cut disc", "cut triangle", "flat board"])
def test_points_are_on_visible_edges(name):
    """No point is wasted on edges outside of the image; the value jumps by what is said on the side said."""
    scene = SCENES[name]
    with jax.enable_x64(True):
        u = jnp.asarray((np.arange(1000) + 0.5)[:, None] / 1000)
        point, jump = jax.jit(scene.boundary)(u)
        slide = jax.jit(lambda u: jax.jvp(lambda u: scene.boundary(u)[0], (u,), (jnp.ones_like(u),)))
        _, tangent = slide(u)
        point, jump, tangent = map(np.asarray, (point, jump, tangent))
        assert np.all((point >= -1e-12) & (point <= 1 + 1e-12))
        turned = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
        turned *= 1e-7 / np.linalg.norm(turned, axis=-1, keepdims=True)
        after, before = (np.asarray(jax.jit(scene.__call__)(point + side)) for side in (turned, -turned))
    assert np.mean(after - before != jump) <= 0.002  # but next to a corner


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_empty_pieces_are_not_hit(dtype):
    """Neither first nor last, for the least and the largest u, whatever the lengths add up to."""
    with jax.enable_x64(True):
        u, spread_of = np.array([0, 0.5, 1 - np.finfo(dtype).epsneg], dtype), jax.jit(spread)
        for length in np.random.default_rng(1).random((50, 2)).astype(dtype):
            piece, position = map(np.asarray, spread_of(u, np.array([0, length[0], 0, length[1], 0], dtype)))
            assert piece[0] == 1 and piece[2] == 3 and np.isin(piece[1], [1, 3])
            assert np.all(position >= 0) and np.all(position <= length[piece // 2])
        assert np.array_equal(spread_of(u, np.zeros(3, dtype))[1], [0, 0, 0])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_edge_at_the_far_side_is_no_more_in_the_image(dtype):
    """The float before is in the last column: no product with a width is rounded up to it."""
    before = np.nextafter(dtype(1), dtype(0))
    widths = np.arange(1, 2**16 + 1).astype(dtype)
    assert np.all(before * widths < widths)
    for place, swept in ((before, 7), (1, 0)):
        found = estimate(scenes.step(0.0, float(place)), 7, 2, dtype=dtype).offset
        np.testing.assert_allclose(found, [[0] * 6 + [swept]] * 2, rtol=0.2)


def test_sums_are_compensated():
    """A sum of 2**20 equal terms in one pixel is right to 1e-6 in float32."""
    gradient = boundary_gradient(scenes.step(0.0, 0.3), sequences.van_der_corput(), 1, 1, 2**20)
    assert abs(float(gradient.offset[0, 0]) - 1) <= 1e-6


def test_any_n_counts_each_point_once():
    scene, n = SCENES["disc"], 5000  # five blocks, the last one partly
    vdc = sequences.van_der_corput()
    whole = flat(boundary_gradient(scene, vdc, 4, 3, n)) * n
    first = flat(boundary_gradient(scene, vdc, 4, 3, n - 1)) * (n - 1)
    one = abs(whole - first).max(axis=-1)
    assert np.sum(one > 1e-2) == 1
    assert one.max() == pytest.approx(12 * 2 * np.pi * 0.307, rel=1e-2)


@pytest.mark.slow
def test_inside_a_program():
    """Compiled and mapped over keys: the same."""
    scene = SCENES["disc"]
    one = lambda key: boundary_gradient(scene, sequence("disc", key), 8, 8, 256).radius  # noqa: E731
    keys = jax.random.split(jax.random.key(1), 3)
    mapped = jax.jit(jax.vmap(one))(keys)
    np.testing.assert_allclose(mapped, np.stack([one(key) for key in keys]), rtol=1e-4, atol=1e-4)


test_bad_values_are_named = refused(
    (lambda: estimate(scenes.checkerboard()), "finitely many edges, got a Checker.*flat_checkerboard"),
    (lambda: estimate(Flat()), "scene.boundary must return points .1024, 2. .*got .1024, 1. and .1024,."),
    (lambda: estimate(scenes.heaviside(4)), "sequence must have the 3 dimensions.*Heaviside.*got 1"),
    (lambda: boundary_gradient(scenes.disc(), sequences.hammersley_net(3), 4, 4, 9), "n must be .*8., got 9"),
    (lambda: estimate(scenes.disc(), 65536, 65536), "width times height must be below 2"),
    error=ValueError,
)


METHODS = {"__call__": lambda self, point: point[..., 0], "boundary": lambda self, u: (u, u[..., 0])}
WithoutParameters = type("WithoutParameters", (), METHODS | {"needs": ("x", "y")})
test_wrong_types_are_named = refused(
    (lambda: estimate(scenes.zone_plate()), "scene must have boundary.*ZonePlate"),
    (lambda: estimate(WithoutParameters()), "scene must be a pytree with arrays as parameters"),
    error=TypeError,
)


@pytree
@dataclass(frozen=True)
class Flat:
    """A scene whose boundary is no curve on the plane."""

    level: float = 0.5
    needs = ("x", "y")

    def __call__(self, point):
        return point[..., 0]

    def boundary(self, u):
        return u * self.level, u[..., 0]


def estimate(scene, width=4, height=4, n=16, **options):
    return boundary_gradient(scene, sequences.van_der_corput(), width, height, n, **options)
