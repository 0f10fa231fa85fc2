"""The scenes as functions of a point, and their references against samples, quadrature and themselves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import PERSPECTIVE as SCENES
from scene_tables import evaluated
from scipy import integrate
from tables import each

from qmcjax import scenes
from qmcjax.scenes import _checkerboard_reference, _zone_plate


def random_points(n, seed=1):
    return np.random.default_rng(seed).integers(0, 2**24, (n, 2)).astype(np.float32) * np.float32(2**-24)


def exact_value(scene, x, y):
    """Evaluate the scene by its definition, in numpy and float64."""
    if isinstance(scene, scenes.Checkerboard):
        depth = scene.squares / y
        return ((np.floor((x - 0.5) * depth) + np.floor(depth)) % 2 == 0).astype(float)
    return (1 + np.sin(scene.frequency * (x**2 + y**2))) / 2


def test_scenes_keep_numbers_of_their_own():
    centre = np.array([0.5, 0.5])
    scene = scenes.disc(centre, 0.2)
    centre[:] = np.nan
    np.testing.assert_array_equal(scene.centre, 0.5)
    for made in (scenes.checkerboard(), scenes.zone_plate()):
        assert made.needs == ("x", "y") and len(jax.tree.leaves(made)) == 1


@each("scene", SCENES)
def test_values_follow_the_definition(scene):
    """In float64 the values are the formula's, but where a rounding falls across the border of a square."""
    points = random_points(20000).astype(np.float64) + 2.0**-30
    with jax.enable_x64(True):
        values = evaluated(scene, jnp.asarray(points))
        assert values.dtype == jnp.float64 and values.shape == (20000,)
        values = np.asarray(values)
    far = abs(values - exact_value(scene, points[:, 0], points[:, 1])) > 1e-9
    assert far.mean() <= 1e-4


@each("scene", SCENES)
def test_float32_misses_only_what_rounding_explains(scene):
    """float32 and float64 differ by the rounded phase, or on squares whose border is within the rounding."""
    points = random_points(100000)
    points[:, 1] += np.float32(2**-24)
    single = np.asarray(scene(jnp.asarray(points)), dtype=np.float64)
    x, y = points.astype(np.float64).T
    difference = abs(single - exact_value(scene, x, y))
    if isinstance(scene, scenes.ZonePlate):
        assert np.all(difference <= 4 * 2.0**-24 * (1 + scene.frequency * (x * x + y * y)))
        return
    depth = scene.squares / y
    slack = 3 * 2.0**-24 * depth
    near = [abs(v - np.rint(v)) <= slack for v in (depth, (x - 0.5) * depth)]
    assert not np.any((difference > 0) & ~near[0] & ~near[1])
    # At a given depth a share of 4 slack is near a border; averaged over y this has a logarithm.
    typical = 2.0**-24 * scene.squares
    assert np.mean(difference > 0) <= 20 * typical * np.log(1 / typical)


@each("scene", SCENES)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_corners_and_horizon_are_finite(scene, dtype):
    """Values stay in [0, 1] down to the smallest numbers, at x = 1/2 and on the horizon itself."""
    with jax.enable_x64(True), jax.debug_nans(True), jax.debug_infs(False):
        tiny = float(jnp.finfo(dtype).tiny)
        below = 1 - float(jnp.finfo(dtype).epsneg)
        ends = np.array([0, tiny, 1e-30, 1e-8, 2**-20, 0.25, 0.5, below], dtype)
        points = jnp.asarray(np.stack(np.meshgrid(ends, ends), axis=-1))
        values = scene(points)
        assert values.dtype == dtype and values.shape == points.shape[:-1]
        values = np.asarray(values)
        assert np.all((values >= 0) & (values <= 1))


def test_horizon_is_the_mean():
    """Where squares cannot be told apart the value is 1/2, and just below it is not."""
    y = jnp.array([0, 2**-30, 2**-19, 2**-18.9, 2**-10], dtype=jnp.float32)
    values = scenes.checkerboard(8.0)(jnp.stack([jnp.full_like(y, 0.3), y], axis=-1))
    assert np.array_equal(values == 0.5, [True, True, True, False, False])


def test_zone_plate_gradient():
    """The derivative with respect to the frequency is the finite difference."""
    with jax.enable_x64(True):
        points = jnp.asarray(random_points(50).astype(np.float64))
        mean = lambda frequency: jnp.mean(scenes.zone_plate(frequency)(points))  # noqa: E731
        step = 1e-5
        difference = (mean(100.0 + step) - mean(100.0 - step)) / (2 * step)
        assert abs(jax.grad(mean)(100.0) - difference) < 1e-8


@each("scene", SCENES)
@pytest.mark.parametrize("pixel", [(0, 0), (9, 0), (15, 0), (5, 1), (11, 6), (3, 11)])
def test_reference_agrees_with_samples(scene, pixel):
    """The mean of 10^6 jittered samples is within 5 sigma; the first row touches the horizon."""
    width, height = 16, 12
    image, bound = scene.reference(width, height)
    (column, row), side, rng = pixel, 1000, np.random.default_rng(7)
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    x, y = ((cells + rng.random((side**2, 2))) / side + (column, row)).T
    values = exact_value(scene, x / width, y / height).reshape(side, side)
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
