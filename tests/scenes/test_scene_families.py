"""Smooth and high-dimensional scenes against their definitions, quadrature, samples and themselves."""

import itertools
import math
import re
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

import qmcjax as qj
from qmcjax import samplers, scenes, sequences
from qmcjax.scenes import _genz_reference
from qmcjax.scenes._factors import bell_means

FAMILIES = ("oscillatory", "product_peak", "corner_peak", "gaussian", "continuous", "discontinuous")
A, U = np.array([1.0, 3.0, 0.5, 5.0]), np.array([0.3, 0.6, 0.4, 0.2])
SCENES = {
    "gaussian": scenes.gaussian(),
    "gaussian, narrow": scenes.gaussian((0.1, 0.5), 0.02),
    "product": scenes.product(),
    **{f"genz, {family}": scenes.genz(family, 4, A, U) for family in FAMILIES},
    "ramp(0)": scenes.ramp(0),
    "ramp(1)": scenes.ramp(1),
    "ramp": scenes.ramp(),
    "path_toy": scenes.path_toy(3),
    "path_toy, no roulette": scenes.path_toy(2, 0.7, None, 2.0),
}
SMOOTH = {name: scene for name, scene in SCENES.items() if name.startswith(("gaussian", "genz", "product"))}
every = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)


def defined(scene, p):
    """Evaluate a scene by its definition, in NumPy and float64, at points with the coordinates first."""
    if isinstance(scene, scenes.Gaussian):
        x, y = p[0] - scene.centre[0], p[1] - scene.centre[1]
        return np.exp(-(x**2 + y**2) / (2 * scene.width**2))
    if isinstance(scene, scenes.Product):
        return math.prod((abs(4 * x - 2) + a) / (1 + a) for x, a in zip(p, scene.a, strict=True))
    if isinstance(scene, scenes.Ramp):
        return p[scene.dimension]
    if isinstance(scene, scenes.PathToy):
        value, weight, (x, y), rest = 0.0, 1.0, p[:2], list(p[2:])
        while True:
            value = value + weight * scene.emission * y
            if not rest:
                return value
            weight = weight * scene.albedo * x
            if scene.survival is not None:
                weight = weight * (rest.pop(0) < scene.survival) / scene.survival
            x, y = (x + rest.pop(0)) % 1, (y + rest.pop(0)) % 1
    a, u = np.broadcast_arrays(scene.difficulty, scene.shift)
    each = list(zip(p, a, u, strict=True))
    return {
        "oscillatory": lambda: np.cos(2 * np.pi * u[0] + sum(a * x for x, a, _ in each)),
        "product_peak": lambda: math.prod(1 / (a**-2.0 + (x - u) ** 2) for x, a, u in each),
        "corner_peak": lambda: (1 + sum(a * x for x, a, _ in each)) ** -(len(each) + 1.0),
        "gaussian": lambda: np.exp(-sum(a**2 * (x - u) ** 2 for x, a, u in each)),
        "continuous": lambda: np.exp(-sum(a * abs(x - u) for x, a, u in each)),
        "discontinuous": lambda: (p[0] <= u[0]) * (p[1] <= u[1]) * np.exp(sum(a * x for x, a, _ in each)),
    }[scene.family]()


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


def sample_errors(scene, log2, seed):
    """Return the differences of means of samples from the reference over 2 x 2 pixels, in sigmas."""
    rng = np.random.default_rng(seed)
    image, bound = scene.reference(2, 2)
    n, value, square = np.zeros(4), np.zeros(4), np.zeros(4)
    for _ in range(2 ** max(log2 - 18, 0)):
        p = rng.random((len(scene.needs), 2 ** min(log2, 18)))
        f = defined(scene, p)
        pixel = (2 * p[1]).astype(int) * 2 + (2 * p[0]).astype(int)
        n += np.bincount(pixel, minlength=4)
        value += np.bincount(pixel, f, minlength=4)
        square += np.bincount(pixel, f * f, minlength=4)
    mean = value / n
    sigma = np.sqrt(np.maximum(square / n - mean * mean, 0) / n)
    return (abs(mean - image.ravel()) - bound) / np.maximum(sigma, 1e-300)


@every
def test_values_follow_the_definition(scene):
    """In float64 the values are the formula's; in float32 they are close unless a rounding meets a jump."""
    points = np.random.default_rng(1).random((2000, len(scene.needs)))
    with jax.enable_x64(True):
        values = scene(jnp.asarray(points))
        assert values.dtype == jnp.float64 and values.shape == (2000,)
        np.testing.assert_allclose(values, defined(scene, points.T), rtol=1e-12, atol=1e-13)
    points = points.astype(np.float32)
    single = scene(jnp.asarray(points))
    assert single.dtype == jnp.float32
    expected = defined(scene, points.T.astype(np.float64))
    far = abs(np.asarray(single) - expected) > 3e-5 * np.maximum(abs(expected), 0.03 * abs(expected).max())
    assert far.mean() <= 1e-3


@every
def test_pixels_sum_to_coarser_pixels(scene):
    """Four sub-pixels average to one to 1e-12 of the largest, also where the resolution is odd."""
    for width, height in ((1, 1), (7, 5), (128, 96)):
        image, bound = scene.reference(width, height)
        finer, finer_bound = scene.reference(2 * width, 2 * height)
        assert image.shape == (height, width) and image.dtype == np.float64
        average = finer.reshape(height, 2, width, 2).mean(axis=(1, 3))
        assert abs(average - image).max() <= bound + finer_bound <= 1e-12 * max(1, image.max())


@every
def test_reference_agrees_with_samples(scene):
    assert sample_errors(scene, 16, 3).max() <= 5


@pytest.mark.slow
@every
def test_reference_agrees_with_many_samples(scene):
    assert sample_errors(scene, 24, 4).max() <= 5


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("pixel", [(0, 0), (1, 2)])
def test_genz_agrees_with_adaptive_quadrature(family, pixel):
    """In three dimensions, with kinks in the third pixel and the third dimension."""
    scene, (column, row) = scenes.genz(family, 3, [2.0, 5.0, 1.5], [0.1, 0.6, 0.45]), pixel
    box = [(column / 4, (column + 1) / 4), (row / 3, (row + 1) / 3), (0.0, 1.0)]
    cut = [[[c for c in kinks(scene, j) if a < c < b]] for j, (a, b) in enumerate(box)]
    options = [{"points": c[0], "epsabs": 1e-13, "epsrel": 1e-12} for c in cut]
    volume, _ = integrate.nquad(lambda *p: float(defined(scene, p)), box, opts=options)
    image, bound = scene.reference(4, 3)
    assert abs(12 * volume - image[row, column]) <= 1e-10 + bound


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
    image, bound = _genz_reference.corner_peak(a, a, 1, 1)
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


def test_path_toy_by_its_recursion():
    """Radiance is what a place emits, and reflects of the mean radiance one bounce later: by quadrature."""
    emission, albedo, bounces = 1.3, 0.8, 21
    x, w = composite(0.0, 1.0, [], 8)
    arriving = 0.0
    for _ in range(bounces):
        radiance = emission * x[:, None] + albedo * x * arriving
        arriving = w @ radiance @ w
    scene = scenes.path_toy(bounces, albedo, 0.4, emission)
    assert len(scene.needs) == 65 and scene.needs[:6] == ("x", "y", "survival1", "u1", "v1", "survival2")
    image, bound = scene.reference(2, 2)
    means = np.array([0.25, 0.75])
    assert abs(emission * means[:, None] + albedo * means * arriving - image).max() <= bound <= 2e-14


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
        gradients = jax.jit(jax.grad(mean))([jnp.asarray(leaf) for leaf in moving])
        gradients = [np.asarray(gradient) for gradient in gradients]
        assert abs(mean(leaves) - scene.reference(2, 2)[0][1, 0]) <= 1e-9
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


def test_jump_has_no_plain_derivative():
    point = jnp.full((4, 3), 0.25)
    with pytest.raises(ValueError, match=r"Genz\.shift moves an edge"):
        jax.grad(lambda u: jnp.sum(scenes.genz("discontinuous", 3, 1.0, u)(point)))(jnp.full(3, 0.5))


@pytest.mark.parametrize(
    "make",
    [
        lambda v: scenes.gaussian((v[0], 0.5), v[2]),
        lambda v: scenes.product(v[:2]),
        lambda v: scenes.genz("product_peak", 2, v[2], v[:2]),
        lambda v: scenes.genz("discontinuous", 2, v[:2], v[2]),
        lambda v: scenes.path_toy(1, v[0], v[1], v[2]),
    ],
)
def test_vmap_over_parameters_is_a_loop(make):
    """And a new parameter is a new leaf, not a new program."""
    parameters = jnp.asarray([[0.3, 0.6, 0.7], [0.2, 0.9, 0.4], [0.5, 0.5, 1.0]], jnp.float32)
    points = jnp.asarray(np.random.default_rng(2).random((50, len(make(parameters[0]).needs))), jnp.float32)
    compiled = jax.jit(lambda scene: scene(points))
    looped = np.stack([compiled(make(v)) for v in parameters])
    mapped = jax.jit(jax.vmap(lambda v: make(v)(points)))(parameters)
    np.testing.assert_allclose(mapped, looped, rtol=2e-5)
    assert not np.array_equal(looped[0], looped[1])
    assert compiled._cache_size() == 1


def test_ramp_shows_a_dimension():
    """With one sample a pixel the image is a coordinate of the sampler, as in Fig. 8 of the Z paper."""
    sampler = samplers.full_screen(sequences.sobol(6), 16, 16)
    y, x = np.indices((16, 16), dtype=np.uint32)
    drawn = jax.jit(lambda sampler, *where: sampler(*where, dims=(5,)))
    shown = drawn(sampler, x, y, np.zeros((16, 16), np.uint32))[..., 0]
    scene = scenes.ramp(5)
    assert np.array_equal(qj.render(scene, sampler, 16, 16, 1), shown)
    assert scene.needs == ("x", "y", "u2", "u3", "u4", "u5")
    assert np.array_equal(scene.varies(jnp.zeros((2, 6)), jnp.ones((2, 6)))[1], [False] * 5 + [True])
    assert scenes.ramp(0).needs == ("x", "y")


@pytest.mark.parametrize(
    ("make", "message"),
    [(lambda: scenes.genz("gaussian", 3, [1, 2]), "difficulty must have shape (3,), got (2,): [1, 2]")],
)
def test_bad_parameters(make, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


@every
def test_bad_resolutions(scene):
    with pytest.raises(ValueError, match=r"width must be an integer in \[1, 65536\], got 0"):
        scene.reference(0, 4)
    with pytest.raises(ValueError, match=r"height must be an integer in \[1, 65536\], got 65537"):
        scene.reference(4, 65537)
