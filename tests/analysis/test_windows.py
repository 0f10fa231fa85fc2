"""Circular discrepancy in windows: all arcs by brute force, and the lattice that bounds it."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

import analysis
from analysis._structure.windows import WINDOWS
from qmcjax import samplers, sequences


def circular(values):
    """Return the discrepancy over all arcs from a value to a value, closed and open, times n."""
    n, worst = len(values), 1.0
    for one, other in itertools.product(values, values):
        length = (other - one) % 1
        inside = (values - one) % 1
        worst = max(worst, np.sum(inside <= length) - n * length)
        if length:
            worst = max(worst, n * length - np.sum((inside > 0) & (inside < length)))
    return worst


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 2, 3), (3, 1, 2), (2, 2, 2)])
def test_the_worst_of_all_windows_and_arcs(shape):
    values = np.random.default_rng(2).random((4, 5, 6))
    places = itertools.product(*(range(n - k + 1) for n, k in zip(values.shape, shape, strict=True)))
    windows = [values[tuple(slice(a, a + k) for a, k in zip(at, shape, strict=True))] for at in places]
    expected = max(circular(window.ravel()) for window in windows)
    (found,) = analysis.window_discrepancy(values, [shape])
    assert found == pytest.approx(expected, abs=1e-12)


def test_equally_spaced_values_have_the_least():
    values = (np.arange(60).reshape(1, 60) * 7 / 12 + 0.01) % 1
    found = analysis.window_discrepancy(values, [(1, 1, 12), (1, 1, 13)])
    assert found == pytest.approx([1, 2], abs=1e-12)


@pytest.mark.parametrize("place", [(0, 0, 0), (1000, 70000, 3), (2**32 - 30, 5, 2**32 - 9)])
def test_a_lattice_bounds_all_windows(place):
    """Each of its coordinates, everywhere, also where numbers of pixels and frames wrap around."""
    sampler = samplers.window_lattice(sequences.sobol(16), key=3)
    x, y, frame = (np.uint32(first) + np.arange(8, dtype=np.uint32) for first in place)
    values = np.stack([sampler.at_frame(int(t))(x, y[:, None], 5, dtype=jnp.float64) for t in frame])
    found = np.array([analysis.window_discrepancy(values[..., j]) for j in range(16)])
    assert 2.4 < found.max() < 2.5
    random = np.random.default_rng(1).random((8, 8, 8))
    assert np.all(analysis.window_discrepancy(random) > 1.5 * found.max(axis=0))


def test_pairs_of_coordinates_are_uniform_in_windows():
    """At most .48, of the first four .24, of random points' mean square, ((3/2)^2 - (4/3)^2) / n."""
    sampler = samplers.window_lattice(sequences.sobol(16), key=3)
    x, y = np.arange(5), np.arange(5)[:, None]
    cube = np.stack([sampler.at_frame(t)(x, y, 0, dtype=jnp.float64) for t in range(8)])
    for frames, rows, columns in WINDOWS:
        points = cube[:frames, :rows, :columns].reshape(-1, 16).astype(np.float32)
        for one, other in itertools.combinations(range(16), 2):
            squared = analysis.periodic_discrepancy(points[:, [one, other]]) ** 2
            least = 0.241 if other < 4 else 0.48
            assert float(squared) * len(points) < least * (1.5**2 - (4 / 3) ** 2)


test_bad_input_is_named = refused(
    (np.zeros(4), r"values must have shape \(height, width\) or .* got \(4,\)"),
    ("a", TypeError, "values must be made of real numbers, got 'a'"),
    (np.ones((4, 4)), r"values must be in \[0, 1\), got an array"),
    (np.zeros((4, 4)), [(1, 5, 1)], r"shapes must be an integer in \[1, 4\], got 5"),
    (np.zeros((4, 4)), [(3, 3)], TypeError, r"shapes must be triples of frames, .*, got \(3, 3\)"),
    call=analysis.window_discrepancy,
    error=ValueError,
)
