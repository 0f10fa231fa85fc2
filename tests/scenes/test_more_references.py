"""References of paths, ramps and fine checkerboards, in rational numbers and by samples; images of layers."""

from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest
from tables import each, slow

import qmcjax as qj
from qmcjax import samplers, scenes, sequences


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


@pytest.mark.slow
@pytest.mark.parametrize(("bounces", "survival"), [(2, 0.5), (1, None), (3, None)])
def test_paths_sampled_have_that_mean(bounces, survival):
    scene = scenes.path_toy(bounces, 0.8, survival, 2.0)
    per_bounce = ["u{}", "v{}"] if survival is None else ["survival{}", "u{}", "v{}"]
    assert scene.needs == ("x", "y", *(name.format(k + 1) for k in range(bounces) for name in per_bounce))
    image, error = qj.estimated_reference(scene, 3, 3, 4096, key=1)
    exact, bound = scene.reference(3, 3)
    assert abs(image - exact).max() <= error + bound
    assert error < 0.1


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


COLOURS = scenes.function(lambda p: jnp.stack([p[..., 0], p[..., 1], 0 * p[..., 0] + 0.25], -1), ("x", "y"))


@pytest.mark.slow
@each("still", {"grey": scenes.checkerboard(), "colours": COLOURS})
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_layers_are_a_mixture_by_cover(still, dtype):
    """Object times cover plus rest times what is behind, each by render_adaptive; counts add up."""
    moving = scenes.ball([[0.2, 0.3]], [[0.7, 0.6]], (), 0.15)
    sampler = samplers.independent(sequences.sobol(3), key=1)
    result = qj.render_layers(moving, still, sampler, 12, 9, 32, 8, shade=0.75, dtype=dtype)
    cover = qj.render_adaptive(moving, sampler, 12, 9, 32, dtype=dtype)
    behind = qj.render_adaptive(still, sampler, 12, 9, 8, dtype=dtype)
    share = np.asarray(cover.image)[(...,) if behind.image.ndim == 2 else (..., None)]
    assert result.image.dtype == dtype
    np.testing.assert_allclose(
        result.image, 0.75 * share + (1 - share) * np.asarray(behind.image), rtol=0, atol=1e-6
    )
    np.testing.assert_array_equal(result.counts, cover.counts + behind.counts)
    assert result.saving == pytest.approx(1 - result.counts.sum() / (12 * 9 * 40))
    assert 0 < result.saving < 1
    off = cover.counts == 1
    assert off.any()
    assert not off.all()
    np.testing.assert_array_equal(np.asarray(result.image)[off], np.asarray(behind.image)[off])


def test_layers_name_their_scenes():
    sampler = samplers.independent(sequences.sobol(3), key=1)
    with pytest.raises(TypeError, match=r"still must be a scene .* got None"):
        qj.render_layers(scenes.ball(), None, sampler, 4, 4, 4, 4)
    with pytest.raises(ValueError, match=r"still_spp must be an integer .* got 0"):
        qj.render_layers(scenes.ball(), scenes.disc(), sampler, 4, 4, 4, 0)
