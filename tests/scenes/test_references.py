"""References of all scenes against themselves and samples; those in perspective, of paths and of ramps."""

from fractions import Fraction
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import EVERY, MOTION, PERSPECTIVE, PLANE, SMOOTH, defined, evaluated
from scipy import integrate
from scipy.stats import qmc
from scipy.stats import t as student
from tables import each, slow

import qmcjax as qj
from qmcjax import samplers, scenes, sequences
from qmcjax.scenes import _checkerboard_reference, _zone_plate


@each("name", {name: name for name in EVERY})
def test_double_resolution(name):
    """Four sub-pixels average to one, also where the resolution is odd, within bounds that are small."""
    scene = EVERY[name]
    off = 1e-9 if name in PERSPECTIVE else 1e-11 if name == "huge disc" else 1e-12
    most = {**dict.fromkeys(PLANE, np.inf), **dict.fromkeys(MOTION, 3e-12)}.get(name, off)
    for width, height in ((1, 1), (7, 5), *([(48, 40)] if name in MOTION else [(33, 64), (128, 96)])):
        image, bound = scene.reference(width, height)
        finer, finer_bound = scene.reference(2 * width, 2 * height)
        assert image.shape == (height, width) and image.dtype == np.float64
        scale = max(1, image.max()) if name in SMOOTH else 1
        if name not in SMOOTH:
            assert image.min() >= -bound and image.max() <= 1 + bound
        average = finer.reshape(height, 2, width, 2).mean(axis=(1, 3))
        assert abs(average - image).max() <= min(bound + finer_bound, off * scale)
        assert bound + finer_bound <= most * scale


@cache
def nets(dims):
    """Return 32 scrambled nets of 2**13 points in each of 3 x 2 pixels, shape (2, 3, 32, 2**13, dims)."""
    made = [qmc.Sobol(dims, bits=24, rng=np.random.default_rng(k)).random(2**13) for k in range(32)]
    points = np.broadcast_to(np.stack(made), (2, 3, 32, 2**13, dims)).copy()
    rows, columns = np.indices((2, 3))[..., None, None]
    points[..., 0] = (points[..., 0] + columns) / 3
    points[..., 1] = (points[..., 1] + rows) / 2
    return points.astype(np.float32)


@each("name", {name: name for name in PLANE | MOTION | SMOOTH})
def test_reference_agrees_with_samples(name):
    """The means of nets are within 5 sigma in each pixel: the quantile of Student's t as unlikely.

    Most intervals are as narrow as those of 2**24 independent samples.
    """
    scene = EVERY[name]
    image, bound = scene.reference(3, 2)
    means = np.asarray(evaluated(scene, nets(len(scene.needs))), np.float64).mean(axis=-1)
    # Where all agree, one point in all nets may be as probable as chance leaves unseen.
    least = 1 / (32 * 2**13) if name in PLANE else 0
    sigma = np.maximum(means.std(axis=-1, ddof=1) / np.sqrt(32), least)
    off = abs(means.mean(axis=-1) - image)
    assert np.all(off <= student.isf(5.7e-7 / 2, 31) * sigma + 1e-6 * max(1, image.max()) + bound)


@each("scene", EVERY)
def test_bad_resolutions(scene):
    for method in (
        scene.reference,
        *([scene.reference_gradient] if hasattr(scene, "reference_gradient") else []),
    ):
        with pytest.raises(ValueError, match=r"width must be an integer in \[1, 65536\], got 0"):
            method(0, 4)
        with pytest.raises(ValueError, match=r"height must be an integer in \[1, 65536\], got 65537"):
            method(4, 65537)
        with pytest.raises(TypeError, match="height must be an integer"):
            method(4, 2.5)


@each("scene", PERSPECTIVE)
@pytest.mark.parametrize("pixel", [(0, 0), (9, 0), (15, 0), (5, 1), (11, 6), (3, 11)])
def test_perspective_agrees_with_samples(scene, pixel):
    """The mean of 10^6 jittered samples is within 5 sigma; the first row touches the horizon."""
    width, height = 16, 12
    image, bound = scene.reference(width, height)
    (column, row), side, rng = pixel, 1000, np.random.default_rng(7)
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    x, y = ((cells + rng.random((side**2, 2))) / side + (column, row)).T
    values = defined(scene, np.stack([x / width, y / height])).reshape(side, side)
    # Neighbouring cells estimate the variance within a cell from above.
    sigma = np.sqrt(np.mean(np.diff(values, axis=1) ** 2) / 2) / side
    assert abs(values.mean() - image[row, column]) <= 5 * sigma + bound


@pytest.mark.parametrize(("column", "row"), [(9, 5), (2, 9)])
def test_checkerboard_agrees_with_quadrature(column, row):
    """Adaptive quadrature over y of scan lines counted square by square."""
    scene, width, height = scenes.checkerboard(), 16, 12

    def line(y):
        ends = (np.array([column, column + 1]) / width - 0.5) * scene.squares / y
        cuts = np.concatenate([ends[:1], np.arange(np.floor(ends[0]) + 1, ends[1]), ends[1:]])
        parity = (np.floor(0.5 * (cuts[1:] + cuts[:-1])) + np.floor(scene.squares / y)) % 2
        return np.sum(np.diff(cuts)[parity == 0]) * y / scene.squares

    top, bottom = row / height, (row + 1) / height
    depths = np.arange(np.ceil(scene.squares / bottom), scene.squares / top)
    mean, _ = integrate.quad(line, top, bottom, points=scene.squares / depths, limit=2000, epsabs=1e-12)
    image, bound = scene.reference(width, height)
    assert abs(mean * width * height - image[row, column]) <= bound + 1e-8


@pytest.mark.parametrize("squares", [0.37, 8.0, 2000.0, 1e9])
@pytest.mark.parametrize(("width", "height"), [(16, 8), (15, 9), (128, 128)])
def test_checkerboard_does_not_depend_on_the_horizon(squares, width, height):
    """Square by square or by whole periods: the sum over the squares up to the horizon is the same."""
    near, bound = _checkerboard_reference.pixel_means(squares, width, height)
    far, far_bound = _checkerboard_reference.pixel_means(squares, width, height, horizon=5003)
    assert abs(near - far).max() <= bound + far_bound < 1e-11


def test_checkerboard_of_unresolvably_many_squares():
    """Beyond double precision every pixel is the mean."""
    image, bound = scenes.checkerboard(1e20).reference(8, 4)
    assert np.all(image == 0.5) and 0 < bound < 1e-30
    image, bound = scenes.checkerboard(1e12).reference(8, 4)
    assert abs(image - 0.5).max() <= bound < 1e-12


@pytest.mark.parametrize(
    ("frequency", "count"), [(1600.0, 512), (1600.0, 799), (1600.0, 800), (2.1, 1), (1e4, 64)]
)
def test_chirp_means(frequency, count):
    """Both Fresnel integrals and quadrature are within the bound of a long sum in long double."""
    means, bound = _zone_plate._chirp_means(frequency, count)
    nodes, weights = np.polynomial.legendre.leggauss(40 + int(frequency / count))
    edges = np.arange(count, dtype=np.longdouble)[:, None]
    x = (edges + (1 + nodes.astype(np.longdouble)) / 2) / count
    phase = np.longdouble(frequency) * x * x
    expected = (np.cos(phase) @ weights + 1j * (np.sin(phase) @ weights)) / 2
    assert abs(means - expected).max() <= bound <= 1e-9


def test_accuracy_at_512():
    """The bounds that the docstrings promise, and the symmetries of the scenes."""
    image, bound = scenes.checkerboard().reference(512, 512)
    assert bound <= 1e-10
    assert abs(image + image[:, ::-1] - 1).max() <= 2 * bound
    assert abs(image.mean() - 0.5) <= bound
    image, bound = scenes.zone_plate().reference(512, 512)
    assert bound <= 1e-12
    assert abs(image - image.T).max() <= 2 * bound
    whole, whole_bound = scenes.zone_plate().reference(1, 1)
    assert abs(image.mean() - whole[0, 0]) <= bound + whole_bound


@pytest.mark.parametrize("bounces", [1, 2, 30, 340])
@pytest.mark.parametrize(("albedo", "survival"), [(0.9, 0.5), (0.3, None), (1.0, 1.0)])
def test_paths_have_the_geometric_series_as_mean(bounces, albedo, survival):
    """Added up bounce by bounce in rational numbers: emission, then all that arrives from elsewhere."""
    width, height, emission = 5, 3, 1.7
    image, bound = scenes.path_toy(bounces, albedo, survival, emission).reference(width, height)
    arriving, reflected = Fraction(0), Fraction(1)
    for _ in range(bounces):
        arriving += reflected * Fraction(emission) / 2
        reflected *= Fraction(albedo) / 2
    for y in range(height):
        for x in range(width):
            seen = Fraction(emission) * Fraction(2 * y + 1, 2 * height)
            exact = seen + Fraction(albedo) * Fraction(2 * x + 1, 2 * width) * arriving
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    assert 0 < bound < 1e-12


@pytest.mark.parametrize("dimension", [0, *slow(1, 2, 7)])
def test_ramps_show_one_coordinate(dimension):
    scene, sides = scenes.ramp(dimension), (5, 3)
    assert scene.needs == ("x", "y", *(f"u{k}" for k in range(2, dimension + 1)))
    image, bound = scene.reference(*sides)
    for y in range(3):
        for x in range(5):
            pixel = (x, y)[dimension] if dimension < 2 else 0
            exact = Fraction(2 * pixel + 1, 2 * sides[dimension]) if dimension < 2 else Fraction(1, 2)
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    low = jnp.zeros((4, len(scene.needs)))
    varies = np.asarray(scene.varies(low, low + 0.5))
    np.testing.assert_array_equal(varies, np.tile(np.arange(len(scene.needs)) == dimension, (4, 1)))
    sampler = samplers.independent(sequences.sobol(max(2, dimension + 1)), key=1)
    result = qj.render_adaptive(scene, sampler, 5, 3, 64)
    np.testing.assert_allclose(result.image, qj.render(scene, sampler, 5, 3, 64), rtol=0, atol=1e-6)
    np.testing.assert_allclose(result.image, image, rtol=0, atol=0.05)


@pytest.mark.parametrize("squares", [1e4, 12345.678, 1e6])
def test_fine_flat_checkerboards_in_rational_numbers(squares):
    """Not turned, the mean over a pixel is a product of means of square waves along its sides."""
    width, height = 7, 5
    image, bound = scenes.flat_checkerboard(squares, angle=0.0).reference(width, height)

    def wave(position):
        """Integrate (-1)^floor(squares t) from the centre on: the distance to the nearest even square."""
        t = Fraction(squares) * (position - Fraction(1, 2))
        return abs(t - 2 * round(t / 2)) / Fraction(squares)

    for y in range(height):
        for x in range(width):
            sides = [
                (wave(Fraction(k + 1, n)) - wave(Fraction(k, n))) * n for k, n in ((x, width), (y, height))
            ]
            exact = (1 + sides[0] * sides[1]) / 2
            assert abs(Fraction(float(image[y, x])) - exact) <= bound
    assert bound < 1e-6


@pytest.mark.parametrize("squares", [1e4, *slow(1e6)])
def test_fine_checkerboards_in_perspective_by_samples(squares):
    scene = scenes.checkerboard(squares)
    exact, bound = scene.reference(6, 4)
    image, error = qj.estimated_reference(scene, 6, 4, 2**14, key=1)
    assert abs(image - exact).max() <= error + bound
    assert abs(exact - 0.5).max() < 100 / squares


@pytest.mark.slow
def test_fine_checkerboards_in_one_strip():
    """One row and many columns: the mean over y of square waves in 1/y, added square by square."""
    squares, width = 1e4, 3
    exact, bound = scenes.checkerboard(squares).reference(width, 1)
    # Rows of squares from the lower edge to depth 10^7; beyond, at most 1/1000 of the image.
    n = np.arange(10_000, 2_000_000, dtype=np.float64)
    high, low = squares / n, squares / (n + 1)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    total = np.zeros(width)
    for node, weight in zip(nodes, weights, strict=True):
        y = 0.5 * (high + low) + 0.5 * node * (high - low)
        depth = squares / y
        for k in range(width):
            left, right = (k / width - 0.5) * depth, ((k + 1) / width - 0.5) * depth
            across = abs(right - 2 * np.rint(right / 2)) - abs(left - 2 * np.rint(left / 2))
            total[k] += np.sum(0.5 * weight * (high - low) * (-1) ** (n % 2) * across / depth * width)
    beyond = squares / 2_000_000
    np.testing.assert_allclose(exact[0], 0.5 + 0.5 * total, rtol=0, atol=bound + beyond * 3e-4 + 1e-6)
