"""Networks of Open Image Denoise in JAX, against its own library."""

import sys
from importlib.util import find_spec
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from qmcjax.bridges import oidn
from qmcjax.bridges.oidn import _weights

TOLERANCE = 1e-5
installed = pytest.mark.skipif(find_spec("pyoidn") is None, reason="pyoidn is not installed")


def images(seed, count):
    """Return noisy images of some size and brightness, often with NaN and negative values, and more."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 90, 2)
    y, x, _ = np.mgrid[:height, :width, :1]
    image = (1 + np.sin(x / 9) * np.cos(y / 7)) * rng.lognormal(0, 0.5, (height, width, 3))
    image *= 10 ** rng.uniform(-3, 3)
    if seed % 2 == 0:
        image[rng.random((height, width)) < 0.05] = np.nan
        image[rng.random((height, width)) < 0.05] *= -1
    others = [rng.uniform(-0.1, 1.1, image.shape), rng.uniform(-1.1, 1.1, image.shape)]
    return [each.astype(np.float32) for each in (image, *others)[:count]]


@installed
@pytest.mark.parametrize(
    "seed", [*range(3), *(pytest.param(k, marks=pytest.mark.slow) for k in range(3, 20))]
)
def test_equal_to_the_library(seed):
    """On 20 images of other sizes, bounded or not, dark or bright, with and without albedo and normals."""
    pyoidn = pytest.importorskip("pyoidn")
    given, hdr = images(seed, 1 + seed % 3), seed % 5 < 3
    found = np.asarray(oidn.denoiser(hdr)(*given))
    expected = pyoidn.denoise(*given, hdr=hdr)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * expected.max())


@installed
def test_black_is_black():
    pyoidn = pytest.importorskip("pyoidn")
    black = np.zeros((5, 20, 3), np.float32)
    found = np.asarray(oidn.denoiser()(black))
    np.testing.assert_allclose(found, pyoidn.denoise(black, hdr=True), atol=1e-6)


@installed
def test_transformations():
    """Compiled, in batches, and its derivative against differences."""
    denoise, (image, albedo) = oidn.denoiser(), images(1, 2)
    image, albedo = image[:40, :24] / image.mean(), albedo[:40, :24]
    expected = denoise(image, albedo)
    np.testing.assert_allclose(jax.jit(denoise)(image, albedo), expected, rtol=1e-4, atol=1e-5)
    batch = jax.vmap(denoise)(jnp.stack([image, 2 * image]), jnp.stack([albedo, albedo]))
    np.testing.assert_allclose(batch[0], expected, rtol=1e-4, atol=1e-5)
    # Exposure is automatic: twice the light is twice the result.
    np.testing.assert_allclose(batch[1], 2 * expected, rtol=1e-4, atol=1e-5)

    def loss(image):
        return (denoise(image) ** 2).mean()

    slope = jax.grad(loss)(image)
    np.testing.assert_allclose((slope * image).sum(), 2 * loss(image), rtol=1e-3)
    brighter = image * np.linspace(0, 1, 24, dtype=np.float32)[:, None]
    step = 0.01
    difference = (loss(image + step * brighter) - loss(image - step * brighter)) / (2 * step)
    np.testing.assert_allclose((slope * brighter).sum(), difference, rtol=0.01)


def test_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    _weights.networks.cache_clear()
    with pytest.raises(ImportError, match=r"not installed: pip install 'qmcjax\[oidn\]'"):
        oidn.denoiser()


@installed
def test_other_networks_are_refused(monkeypatch):
    """As of a version that has the tables cut off: the message counts parameters."""
    whole = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: whole(path).replace(b"\xd7\x41\2\0", b"    ", 1))
    _weights.networks.cache_clear()
    with pytest.raises(ValueError, match=r"networks of Open Image Denoise 2.5 .* parameters in 22 networks"):
        oidn.denoiser()
    _weights.networks.cache_clear()


IMAGE = np.ones((4, 6, 3), np.float32)


test_arguments = installed(
    refused(
        (lambda d: d(np.ones((4, 6, 3), int)), TypeError, "image must be floats of shape"),
        (
            lambda d: d(jnp.ones((4, 6, 3), int)),
            TypeError,
            "image must be floats of .* got an array of int32",
        ),
        (lambda d: d("a"), TypeError, "image must be floats"),
        (lambda d: d(np.ones((4, 6))), ValueError, r"image must be floats of .*, got \(4, 6\)"),
        (lambda d: d(IMAGE[:0]), ValueError, r"got \(0, 6, 3\)"),
        (lambda d: d(IMAGE, IMAGE[1:]), ValueError, r"albedo must have the shape of image, .* \(3, 6, 3\)"),
        (lambda d: d(IMAGE, None, IMAGE), ValueError, "albedo must be given with normal"),
        (lambda d: oidn.denoiser(hdr=1), TypeError, "hdr must be True or False, got 1"),
        call=lambda call: call(oidn.denoiser()),
    )
)
