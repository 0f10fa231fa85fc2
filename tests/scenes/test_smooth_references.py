"""Exact pixel means and gradients of smooth and high-dimensional scenes."""

import itertools
import math
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import FAMILIES, defined
from scene_tables import SMOOTH as SCENES
from scipy import integrate

from qmcjax import scenes
from qmcjax.scenes import _genz
from qmcjax.scenes._products import bell_means

SMOOTH = {name: scene for name, scene in SCENES.items() if name.startswith(("gaussian", "genz", "product"))}


def kinks(scene, axis):
    """Return where a scene has kinks or jumps along an axis."""
    if isinstance(scene, scenes.Product):
        return [0.5]
    return [float(scene.shift[axis])] if isinstance(scene, scenes.Genz) else []


def composite(low, high, cuts, count=40):
    """Return Gauss-Legendre nodes and weights of the mean over an interval that is cut."""
    ends = [low, *[c for c in cuts if low < c < high], high]
    nodes, weights = np.polynomial.legendre.leggauss(count)
    x = [a + (b - a) * (1 + nodes) / 2 for a, b in itertools.pairwise(ends)]
    w = [(b - a) / (high - low) * weights / 2 for a, b in itertools.pairwise(ends)]
    return np.concatenate(x), np.concatenate(w)


@pytest.mark.parametrize("scene", SMOOTH.values(), ids=SMOOTH)
@pytest.mark.parametrize("pixel", [(0, 0), (3, 4)])
def test_products_agree_with_quadrature(scene, pixel):
    """Products of one-dimensional integrals, and for the corner peak Gauss quadrature of the sum."""
    dims, (column, row) = len(scene.needs), pixel
    box = [(column / 9, (column + 1) / 9), (row / 7, (row + 1) / 7), *[(0.0, 1.0)] * (dims - 2)]
    image, bound = scene.reference(9, 7)
    if getattr(scene, "family", "") in ("oscillatory", "corner_peak"):
        rules = [composite(*side, [], 24) for side in box]
        grid = np.meshgrid(*[x for x, _ in rules], indexing="ij")
        weight = math.prod(np.meshgrid(*[w for _, w in rules], indexing="ij"))
        expected = np.sum(weight * defined(scene, grid))
    else:
        # f(x, y, z, ...) = f(x, y0, z0, ...) f(x0, y, z0, ...) ... / f(x0, y0, z0, ...)**(dims - 1)
        base = np.full(dims, 0.05)
        expected = defined(scene, base)
        for j, side in enumerate(box):
            x, w = composite(*side, kinks(scene, j), 200)
            points = np.repeat(base[:, None], len(x), axis=1)
            points[j] = x
            expected *= w @ defined(scene, points) / defined(scene, base)
    assert abs(expected - image[row, column]) <= 1e-12 * max(1, image.max()) + bound


@pytest.mark.parametrize(("dims", "a"), [(2, 1e-6), (2, 3.0), (9, 0.01), (12, 1.0), (16, 100.0), (6, 1e5)])
def test_corner_peak_keeps_its_digits(dims, a):
    """The alternating sum over the corners in fractions, where in floating point nothing would be left."""
    a = np.full(dims, a) * (1 + np.arange(dims) % 2)
    peak = Fraction(0)
    exact = [Fraction(float(v)) for v in a]
    for corner in itertools.product((0, 1), repeat=dims):
        total = 1 + sum((v for v, on in zip(exact, corner, strict=True) if on), Fraction(0))
        peak += Fraction((-1) ** sum(corner)) / total
    peak /= math.factorial(dims) * math.prod(exact)
    image, bound = _genz.corner_peak(a, a, 1, 1)
    assert abs(image[0, 0] / float(peak) - 1) <= 1e-14
    assert abs(image[0, 0] - float(peak)) <= bound


@pytest.mark.parametrize("family", FAMILIES)
def test_genz_in_16_dimensions(family):
    """All families reach 16 dimensions with a bound below 1e-12 of the image."""
    scene = scenes.genz(family, 16, 2.0, 0.9)
    image, bound = scene.reference(3, 2)
    assert 0 < bound <= 1e-12 * max(abs(image).max(), family == "oscillatory")
    assert np.isfinite(np.asarray(scene(jnp.full((2, 16), 0.5)))).all()


@pytest.mark.parametrize("low", [-20.0, -3.0, -0.5, 0.0, 0.3, 2.0, 7.0, 25.0])
@pytest.mark.parametrize("length", [2.0**-24, 0.25, 0.9, 1.1, 4.0, 40.0])
def test_bell_keeps_relative_digits_in_the_tails(low, length):
    means = bell_means(np.array([low]), length)
    high = min(low + length, max(low, 0) + 9)
    ends = [low, *[c for c in (-3.0, 0.0, 3.0) if low < c < high], high]
    bell = lambda z: math.exp(-z * z)  # noqa: E731
    parts = [integrate.quad(bell, a, b, epsabs=0, epsrel=1e-13)[0] for a, b in itertools.pairwise(ends)]
    expected = sum(parts)
    assert abs(means[0] * length / expected - 1) <= 2e-13


def mean_in_pixel(scene, rules):
    """Average a scene over a tensor of quadrature nodes."""
    grid = np.stack(np.meshgrid(*[x for x, _ in rules], indexing="ij"), axis=-1)
    weight = math.prod(np.meshgrid(*[w for _, w in rules], indexing="ij"))
    return jnp.sum(jnp.asarray(weight) * scene(jnp.asarray(grid)))


GRADIENTS = {
    "gaussian": scenes.gaussian((0.4, 0.6), 0.2),
    "product": scenes.product([0.5, 1.0, 2.0]),
    **{f: scenes.genz(f, 3, [1.0, 2.0, 0.5], [0.3, 0.6, 0.4]) for f in FAMILIES},
}


@pytest.mark.parametrize("scene", GRADIENTS.values(), ids=GRADIENTS)
def test_gradients_are_those_of_the_reference(scene):
    """Of the mean over a pixel, with respect to each parameter, against central differences."""
    box = [(0.0, 0.5), (0.5, 1.0), *[(0.0, 1.0)] * (len(scene.needs) - 2)]
    rules = [composite(*side, kinks(scene, j), 12) for j, side in enumerate(box)]
    jumps = getattr(scene, "family", "") == "discontinuous"
    with jax.enable_x64(True):
        leaves, tree = jax.tree.flatten(scene)
        moving = leaves[:1] if jumps else leaves
        mean = lambda moving: mean_in_pixel(tree.unflatten([*moving, *leaves[len(moving) :]]), rules)  # noqa: E731
        value, gradients = jax.jit(jax.value_and_grad(mean))([np.asarray(leaf) for leaf in moving])
        gradients = [np.asarray(gradient) for gradient in gradients]
        assert abs(float(value) - scene.reference(2, 2)[0][1, 0]) <= 1e-9
    for which, leaf in enumerate(moving):
        for place in np.ndindex(np.shape(leaf)):
            means = []
            for sign in (-1, 1):
                moved = np.array(leaf)
                moved[place] += sign * 1e-5
                other = tree.unflatten([*leaves[:which], moved, *leaves[which + 1 :]])
                means.append(other.reference(2, 2)[0][1, 0])
            assert abs((means[1] - means[0]) / 2e-5 - gradients[which][place]) <= 1e-7


def test_path_toy_gradients():
    """Roulette has no derivative, being unbiased for any survival; albedo and emission have theirs."""
    n = 64
    middle, start = (np.arange(n) + 0.5) / n, np.arange(n) / n
    grid = np.stack(np.meshgrid(middle, middle, [0.25, 0.75], [0.5], start, indexing="ij"), axis=-1)
    with jax.enable_x64(True):
        mean = lambda albedo, survival, emission: jnp.mean(  # noqa: E731
            scenes.path_toy(1, albedo, survival, emission)(jnp.asarray(grid))
        )
        value, gradients = jax.jit(jax.value_and_grad(mean, (0, 1, 2)))(0.6, 0.5, 1.5)
    # emission / 2 + albedo emission / 4
    np.testing.assert_allclose([value, *gradients], [0.975, 0.375, 0.0, 0.65], atol=1e-12)
    np.testing.assert_allclose(scenes.path_toy(1, 0.6, 0.5, 1.5).reference(1, 1)[0], 0.975, atol=1e-15)
