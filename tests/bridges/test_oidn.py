"""Networks of Open Image Denoise in JAX, against its own library."""

import sys
from importlib.util import find_spec
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import slow

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
@pytest.mark.parametrize("seed", [*range(3), *slow(*range(3, 20))])
def test_equal_to_the_library(seed):
    """On 20 images of other sizes, bounded or not, dark or bright, with and without albedo and normals."""
    pyoidn = pytest.importorskip("pyoidn")
    given, hdr = images(seed, 1 + seed % 3), seed % 5 < 3
    found = np.asarray(oidn.denoiser(hdr)(*given))
    expected = pyoidn.denoise(*given, hdr=hdr)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * expected.max())


LIGHT = np.random.default_rng(0).lognormal(0, 0.5, (12, 18, 3)).astype(np.float32)
FEW = np.arange(12 * 18).reshape(12, 18, 1) == 5
EDGES = {
    "black": 0 * LIGHT, "all NaN": np.nan * LIGHT, "all negative": -LIGHT,
    "negative infinity": np.where(FEW, -np.inf, LIGHT), "a NaN": np.where(FEW, np.nan, LIGHT),
    "subnormal": np.float32(1e-44) * LIGHT, "around the least that counts": np.float32(1e-8) * LIGHT,
    "one lit pixel": np.where(FEW, 1, 0 * LIGHT), "one huge pixel": np.where(FEW, 9e29, LIGHT),
    "all huge": np.float32(1e29) * LIGHT,
}  # fmt: skip
BEYOND = {
    "one infinite pixel": np.where(FEW, np.inf, LIGHT),
    "one infinite channel": np.where(FEW & (np.arange(3) == 1), np.inf, LIGHT),
    "the largest pixel": np.where(FEW, np.finfo(np.float32).max, LIGHT),
    "nearly an overflow": np.float32(1e36) * LIGHT,
    "the sum of a bin overflows": np.where(np.arange(18)[:, None] < 2, np.float32(1e38), LIGHT),
    "all sums overflow": np.full_like(LIGHT, 1e38),
    "all infinite": np.full_like(LIGHT, np.inf),
}


@installed
def test_edges_are_those_of_the_library():
    """In a compiled batch; one by one, or an error that names the pixel."""
    pyoidn = pytest.importorskip("pyoidn")
    denoise, given = oidn.denoiser(), np.float32([*EDGES.values(), *BEYOND.values()])
    expected = np.stack([pyoidn.denoise(image, hdr=True) for image in given])
    found = np.asarray(jax.jit(jax.vmap(denoise))(given))
    assert np.isfinite(expected).all()
    for name, image, one, wanted in zip((*EDGES, *BEYOND), given, found, expected, strict=True):
        digits = 1e-5 if name in EDGES else 1e-4
        allowed = digits * wanted.max() + 1e-10
        np.testing.assert_allclose(one, wanted, rtol=0, atol=allowed, err_msg=name)
        if name in EDGES:
            np.testing.assert_allclose(denoise(image), wanted, rtol=0, atol=allowed, err_msg=name)
        else:
            row, column = np.argwhere(image > 1e30)[0, :2]
            with pytest.raises(ValueError, match=rf"at most 1e\+30, got .* in pixel \[{row}, {column}\]"):
                denoise(image)
    bounded = oidn.denoiser(hdr=False)(given[-1])
    np.testing.assert_allclose(bounded, pyoidn.denoise(given[-1], hdr=False), rtol=0, atol=TOLERANCE)


@installed
@pytest.mark.slow
def test_edges_have_finite_derivatives():
    denoise = oidn.denoiser()
    slopes = jax.vmap(jax.grad(lambda image: denoise(image).mean()))
    assert np.isfinite(slopes(np.float32([*EDGES.values(), *BEYOND.values()]))).all()


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
        ((np.ones((4, 6, 3), int),), TypeError, "image must be floats of shape"),
        ((jnp.ones((4, 6, 3), int),), TypeError, "image must be floats of .* got an array of int32"),
        ((np.ones((4, 6)),), ValueError, r"image must be floats of .*, got \(4, 6\)"),
        ((IMAGE, IMAGE[1:]), ValueError, r"albedo must have the shape of image, .* \(3, 6, 3\)"),
        ((IMAGE, None, IMAGE), ValueError, "albedo must be given with normal"),
        call=lambda given: oidn.denoiser()(*given),
    )
)
