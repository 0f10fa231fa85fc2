"""What a denoiser takes, from the layers of one EXR file."""

from os import PathLike

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._exr import Exr, read_exr
from qmcjax.core import checks, tables

_NAMES = {
    "color": ("noisy image", "", "combined", "beauty", "color"),
    "albedo": ("denoising albedo", "albedo"),
    "normal": ("denoising normal", "normal", "normals", "ns", "n"),
}
"""In lower case, the most specific first; empty: what is outside of layers."""


def read_inputs(
    path: str | PathLike[str],
    *,
    color: str | None = None,
    albedo: str | None = None,
    normal: str | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Read the image, its albedo and its normals from the layers of an EXR file.

    Parameters
    ----------
    path : path
        Ends in ``.exr``.
    color, albedo, normal : str, optional
        Their layers, as in :func:`qmcjax.bridges.read_image`. By default they are found by the names of
        Blender ("Noisy Image", or else "Combined"; "Denoising Albedo" and "Denoising Normal") and pbrt
        (channels outside of layers; "Albedo" and "Ns") or simply "albedo" and "normal", in upper or lower
        case and after any prefix.

    Returns
    -------
    tuple of three float32 arrays, shape (height, width, 3)
        Image, albedo and normals, without alpha. NaN is let through: it counts as zero for the denoiser.

    Raises
    ------
    ValueError
        If a layer is not there, or if several are equally likely. The message lists the layers of the file.
        An image without albedo is read by :func:`qmcjax.bridges.read_image`.

    Examples
    --------
    >>> from qmcjax.bridges import oidn
    >>> denoised = oidn.denoiser()(*oidn.read_inputs("render.exr"))  # doctest: +SKIP
    """
    path = checks.path(path)
    checks.suffix_of(path, (".exr",))
    given = {"color": color, "albedo": albedo, "normal": normal}
    for name, layer in given.items():
        if layer is not None and not isinstance(layer, str):
            raise TypeError(f"{name} must be the name of a layer or None, got {checks.shown(layer)}")
    with tables.named(path):
        exr = read_exr(path)
        image, albedos, normals = (_three(exr, name, layer) for name, layer in given.items())
    return image, albedos, normals


def _three(exr: Exr, name: str, layer: str | None) -> NDArray[np.float32]:
    choice = _found(exr, name) if layer is None else layer
    try:
        pixels = exr.pick(None if layer is None and not choice else choice)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if pixels.shape[2] not in (3, 4) or pixels.dtype != np.float32:
        raise ValueError(
            f"{name} must be a layer of 3 channels of floats, got {pixels.shape[2]} of {choice!r}"
        )
    return pixels[..., :3]


def _found(exr: Exr, name: str) -> str:
    """Return the name of the only layer with the first of the likely names that occurs."""
    for likely in _NAMES[name]:
        layers = [
            each
            for each in exr.layers
            if (each == exr.first if not likely else each.rpartition(".")[2].lower() == likely)
        ]
        if len(layers) > 1:
            raise ValueError(f"{name} must be given, since it may be one of {', '.join(map(repr, layers))}")
        if layers and (likely or exr.layers[layers[0]].components in ("RGB", "RGBA")):
            return layers[0]
    raise ValueError(f"{name} must be given, the name of one of the layers {exr.listed()}")
