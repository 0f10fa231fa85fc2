"""References of all scenes against themselves and samples, and their parameters as leaves."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import EVERY, MOTION, PERSPECTIVE, PLANE, SMOOTH, evaluated
from scipy.stats import qmc
from scipy.stats import t as student
from tables import each

from qmcjax import scenes


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


MAKERS = {
    "moving_edge": lambda v: scenes.moving_edge(v[0], v[1]),
    "blinking_disc": lambda v: scenes.blinking_disc(v[:2], v[2], v[2:]),
    "ball": lambda v: scenes.ball(v.reshape(2, 2), 0.5 * v.reshape(2, 2), v[:1], v[1]),
    "defocused_edge": lambda v: scenes.defocused_edge(v[0], v[1], v[2]),
    "soft_shadow": lambda v: scenes.soft_shadow(v[0], v[1], v[2], v[2:]),
    "disc": lambda v: scenes.disc(v[:2], v[2]),
    "checkerboard": lambda v: scenes.checkerboard(9 * v[0]),
    "discontinuous": lambda v: scenes.genz("discontinuous", 2, v[:2], v[2]),
    "zone_plate": lambda v: scenes.zone_plate(v[0]),
    "gaussian": lambda v: scenes.gaussian((v[0], 0.5), v[2]),
    "product": lambda v: scenes.product(v[:2]),
    "genz": lambda v: scenes.genz("product_peak", 2, v[2], v[:2]),
    "path_toy": lambda v: scenes.path_toy(1, v[0], v[1], v[2]),
}


@each("make", MAKERS)
def test_vmap_over_parameters_is_a_loop(make):
    """A new parameter is a new leaf, not a new program; of edges the plain derivative is refused by name."""
    parameters = np.array([[0.3, 0.6, 0.5, 0.9], [0.2, 0.5, 0.4, 0.5]], np.float32)
    points = np.random.default_rng(2).random((200, len(make(parameters[0]).needs)), np.float32)
    count = evaluated._cache_size()
    looped = np.stack([evaluated(make(v), points) for v in parameters])
    assert evaluated._cache_size() == count + 1 and not np.array_equal(*looped)
    mapped = jax.jit(jax.vmap(lambda v: make(v)(points)))(parameters)
    assert np.mean(abs(mapped - looped) > 2e-5 * abs(looped)) <= (
        0.005 if hasattr(make(parameters[0]), "varies") else 0
    )
    if make in list(MAKERS.values())[:5]:
        with pytest.raises(ValueError, match=rf"^{type(make(parameters[0])).__name__}\.\w+ moves an edge"):
            jax.grad(lambda v: jnp.sum(make(v)(points)))(parameters[0])
