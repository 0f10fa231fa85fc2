"""The function from image to image: exposure, a perceptual encoding of values, the network, and back."""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from qmcjax.bridges.oidn._weights import Weights, networks
from qmcjax.core import checks

_FIRST = {True: 2, False: 11}
"""By whether values are unbounded, the network for colour; 2 and 4 on, those with albedo and normals."""

_ALIGNMENT = 16
"""Sides of what a network gets are multiples of this."""

_BIN, _KEY, _DARK = 16, 0.18, 1e-8
"""Of the exposure: the largest side of a bin of pixels, the mean that is aimed at, and what is left out."""

_MOST = float(np.finfo(np.float32).max)

_BRIGHTEST = 1e30
"""Of a known image; beyond, errors of float32 exceed 1e-5, and sums of pixels may overflow."""


@dataclass(frozen=True, eq=False)
class Denoiser:
    """A function of an image, and perhaps of its albedo and normals; made by :func:`denoiser`."""

    hdr: bool
    networks: tuple[Weights, ...] = field(repr=False)

    def __call__(
        self, image: ArrayLike, albedo: ArrayLike | None = None, normal: ArrayLike | None = None
    ) -> Array:
        """Denoise an image.

        Parameters
        ----------
        image : float ArrayLike, shape (height, width, 3)
            Linear light, of any size. NaN and negative values count as zero, as in the library. Traced images
            may also exceed 1e30: as in the library, infinite values are then the largest of float32, and if
            the sum of 16 x 16 pixels overflows, all is black.
        albedo : float ArrayLike, shape of ``image``, optional
            Albedo of the surfaces that are seen, in [0, 1].
        normal : float ArrayLike, shape of ``image``, optional
            Their normals, in [-1, 1]; only with albedo.

        Returns
        -------
        float32 Array, shape of ``image``

        Raises
        ------
        ValueError
            If values are unbounded and one of a known image exceeds 1e30; the message names the pixel.
        """
        given = {"image": image, "albedo": albedo, "normal": normal}
        if albedo is None and normal is not None:
            raise ValueError("albedo must be given with normal: no network takes normals alone")
        images = {name: _checked(name, each) for name, each in given.items() if each is not None}
        for name, each in images.items():
            if each.shape != images["image"].shape:
                raise ValueError(
                    f"{name} must have the shape of image, {images['image'].shape}, got {each.shape}"
                )
        if self.hdr and not isinstance(images["image"], Tracer):
            bad = np.argwhere(np.asarray(images["image"]) > _BRIGHTEST)
            if len(bad):
                row, column = bad[0, :2].tolist()
                value = images["image"][tuple(bad[0])]
                where = f"{value} in pixel [{row}, {column}]"
                raise ValueError(f"image must be at most {_BRIGHTEST:g}, got {where}")
        return _denoise(self.networks[len(images) - 1], *images.values(), hdr=self.hdr)


def denoiser(hdr: bool = True) -> Denoiser:
    """Return the denoiser of Open Image Denoise, a function from image, albedo and normals to image.

    Parameters
    ----------
    hdr : bool
        Whether values are unbounded: exposure is then automatic. Otherwise they end at 1.

    Returns
    -------
    Denoiser
        ``denoise(image, albedo=None, normal=None)``, of float32 images of shape (height, width, 3): for
        ``jax.jit``, ``jax.vmap`` and ``jax.grad``.

    Raises
    ------
    ImportError
        Without the package ``pyoidn``, which ``pip install 'qmcjax[oidn]'`` installs.
    ValueError
        If the networks of its version are not those known.

    Notes
    -----
    Networks learned from images with independent errors in all pixels. They may keep regular patterns of
    errors as textures, see :func:`analysis.denoised_error`.

    References
    ----------
    .. [1] A. T. Áfra, "Intel Open Image Denoise", https://www.openimagedenoise.org.
    """
    first = _FIRST[checks.flag("hdr", hdr)]
    return Denoiser(bool(hdr), networks()[first : first + 6 : 2])


def _checked(name: str, value: Any) -> Array:
    wanted = "floats of shape (height, width, 3)"
    if not isinstance(value, Array):
        value = checks.known_array(name, value, np.floating, wanted)
    if not jnp.issubdtype(value.dtype, jnp.floating):
        raise TypeError(f"{name} must be {wanted}, got {checks.shown(value)}")
    if value.ndim != 3 or value.shape[2] != 3 or not value.size:
        raise ValueError(f"{name} must be {wanted}, got {value.shape}")
    return jnp.asarray(value, jnp.float32)


@partial(jax.jit, static_argnames="hdr")
def _denoise(weights: Weights, color: Array, *auxiliary: Array, hdr: bool) -> Array:
    height, width, _ = color.shape
    light = jnp.clip(_not_nan(color), 0, _MOST)
    to_network, to_light, most = (
        (_log_encode, _log_decode, _MOST) if hdr else (_srgb_encode, _srgb_decode, 1.0)
    )
    stops, visible = _exposure(light) if hdr else (jnp.float32(0), True)
    fixed = jax.lax.stop_gradient(stops)
    # 1, with the derivatives of the exposure: those of a product with a small factor may overflow.
    change = jnp.exp2(stops - fixed)
    scaled = jnp.minimum(light * jnp.exp2(fixed) * change, most)
    # The library cuts infinite values off after it scales them.
    inputs = [to_network(jnp.where(visible, jnp.where(jnp.isposinf(color), most, scaled), 0))]
    for each, low in zip(auxiliary, (0, -1), strict=False):
        inputs.append((jnp.clip(_not_nan(each), low, 1) - low) / (1 - low))
    padding = ((0, -height % _ALIGNMENT), (0, -width % _ALIGNMENT), (0, 0))
    output = _network(weights, jnp.pad(jnp.concatenate(inputs, -1), padding)[None])[0, :height, :width]
    output = to_light(jnp.maximum(_not_nan(output), 0))
    if not hdr:
        return jnp.minimum(output, 1)
    return jnp.where(visible, output / change * jnp.exp2(-fixed), 0)


def _not_nan(x: Array) -> Array:
    return jnp.where(jnp.isnan(x), 0, x)


def _exposure(light: Array) -> tuple[Array, Array]:
    """Return the log2 of the factor to a geometric mean of 0.18, of the luminance of bins of pixels.

    And whether it is not 0: as in the library, it is 0 if the sum of a bin overflows, or if it is subnormal.
    """
    luminance = light @ jnp.array([0.212671, 0.715160, 0.072169], jnp.float32)
    rows, columns = map(_means, luminance.shape)
    bins = jnp.matmul(jnp.matmul(rows, luminance, precision="highest"), columns.T, precision="highest")
    pixels = 1 / (rows.max(1)[:, None] * columns.max(1)[None])
    counted = bins > _DARK
    logarithms = jnp.where(counted, jnp.log2(jnp.where(counted, bins, 1)), 0)
    mean = logarithms.sum() / jnp.maximum(counted.sum(dtype=jnp.float32), 1)
    stops = jnp.where(counted.any(), np.log2(_KEY) - mean, 0)
    visible = (bins <= _MOST / pixels).all() & (stops >= np.log2(np.finfo(np.float32).tiny))
    return jnp.where(visible, stops, 0), visible


def _means(side: int) -> Array:
    """Return the matrix (bins, side) that averages over bins of a side."""
    count = -(-side // _BIN)
    edges = np.arange(count + 1) * side // count
    within = (edges[:-1, None] <= np.arange(side)) & (np.arange(side) < edges[1:, None])
    return jnp.asarray((within / np.diff(edges)[:, None]).astype(np.float32))


def _network(w: Weights, x: Array) -> Array:
    """Map shape (1, height, width, channels), of sides that are multiples of 16, to three channels."""

    def convolve(name: str, x: Array) -> Array:
        y = jax.lax.conv_general_dilated(
            x,
            w[f"{name}.weight"],
            (1, 1),
            "SAME",
            dimension_numbers=("NHWC", "OIHW", "NHWC"),
            precision="highest",
        )
        return y + w[f"{name}.bias"][None, None, None]

    def layer(name: str, x: Array) -> Array:
        return jax.nn.relu(convolve(name, x))

    def pool(x: Array) -> Array:
        return jax.lax.reduce_window(x, -jnp.inf, jax.lax.max, (1, 2, 2, 1), (1, 2, 2, 1), "VALID")

    skipped = [x]
    x = layer("enc_conv1", layer("enc_conv0", x))
    for level in "234":
        skipped.append(pool(x))
        x = layer(f"enc_conv{level}", skipped[-1])
    x = layer("enc_conv5b", layer("enc_conv5a", pool(x)))
    for level in "4321":
        x = jnp.concatenate([x.repeat(2, 1).repeat(2, 2), skipped.pop()], -1)
        x = layer(f"dec_conv{level}b", layer(f"dec_conv{level}a", x))
    return convolve("dec_conv0", x)


# From linear light to what networks were trained on: unbounded values by a perceptually uniform function,
# linear, then a power, then a logarithm; bounded ones by sRGB.
_A, _B, _C, _D, _E, _F, _G = (
    *(1.41283765e03, 1.64593172, 0.431384981, -2.94139609e-03),
    *(0.192653254, 6.26026094e-03, 0.998620152),
)
_Y0, _Y1, _X0, _X1 = 1.57945760e-06, 3.22087631e-02, 2.23151711e-03, 3.70974749e-01
_LARGEST = _E * np.log(65504.0 + _F) + _G


def _log_encode(y: Array) -> Array:
    above = jnp.maximum(y, _Y0)
    curve = jnp.where(y <= _Y1, _B * above**_C + _D, _E * jnp.log(above + _F) + _G)
    return jnp.where(y <= _Y0, _A * y, curve) / _LARGEST


def _log_decode(x: Array) -> Array:
    x = x * _LARGEST
    curve = jnp.where(x <= _X1, ((jnp.maximum(x, _X0) - _D) / _B) ** (1 / _C), jnp.exp((x - _G) / _E) - _F)
    return jnp.where(x <= _X0, x / _A, curve)


def _srgb_encode(y: Array) -> Array:
    return jnp.where(y <= 0.0031308, 12.92 * y, 1.055 * jnp.maximum(y, 0.0031308) ** (1 / 2.4) - 0.055)


def _srgb_decode(x: Array) -> Array:
    return jnp.where(x <= 0.04045, x / 12.92, ((jnp.maximum(x, 0.04045) + 0.055) / 1.055) ** 2.4)
