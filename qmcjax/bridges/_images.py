"""Files of images, in and out."""

from os import PathLike
from pathlib import Path

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.bridges._arrays import parsed_npy
from qmcjax.bridges._exr import encoded_exr, read_exr
from qmcjax.bridges._png import Png, decoded, encoded
from qmcjax.bridges._suffixes import suffix_of
from qmcjax.core import checks

_KNOWN = (".exr", ".npy", ".png")
_TRANSFERS = ("srgb", "linear")
_SHAPES = "(height, width) or (height, width, 3)"


def write_image(
    path: str | PathLike[str], image: ArrayLike, *, transfer: str | None = None, bits: int = 8
) -> None:
    """Write an image, such as the result of :func:`qmcjax.render`, to a file.

    Parameters
    ----------
    path : path
        Ends in ``.exr`` or ``.npy``, for all values in float32; or in ``.png``, for values in [0, 1].
    image : float ArrayLike, shape (height, width) or (height, width, 3), finite linear light
    transfer : {"srgb", "linear"}
        Required for PNG files, which store it: sRGB values, which programs show as they are, or linear light.
        None for other files.
    bits : {8, 16}
        Per channel of a PNG file. Values are clamped to [0, 1] and rounded to nearest.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/grey.png", [[0.0, 0.5, 1.0]], transfer="srgb", bits=16)
    ...     print(read_image(f"{folder}/grey.png"))
    [[0.        0.5000088 1.       ]]
    """
    path = checks.path(path)
    suffix = suffix_of(path, _KNOWN)
    known = checks.known_array("image", image, np.floating, f"floats of shape {_SHAPES}")
    if known.ndim not in (2, 3) or not known.size or known.shape[2:] not in ((), (3,)):
        raise ValueError(f"image must have the shape {_SHAPES}, got {known.shape}")
    known = known.astype(np.float64)
    if not np.isfinite(known).all():
        row, column, *_ = map(int, np.argwhere(~np.isfinite(known))[0])
        raise ValueError(f"image must be finite, got {known[row, column]} in row {row}, column {column}")
    pixels = known.reshape(*known.shape[:2], -1)
    if suffix == ".png":
        transfer = checks.choice("transfer", transfer, _TRANSFERS)
        if checks.integer("bits", bits, 8, 16) not in (8, 16):
            raise ValueError(f"bits must be 8 or 16, got {bits}")
        values = np.clip(pixels, 0, 1)
        values = _srgb_of(values) if transfer == "srgb" else values
        whole = np.rint(values * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
        path.write_bytes(encoded(whole, {"Software": "qmcjax"}, transfer))
        return
    if transfer is not None:
        raise ValueError(f"transfer must be None except for PNG files, got {checks.shown(transfer)}")
    with np.errstate(over="ignore"):
        exact = known.astype(np.float32)
    if not np.isfinite(exact).all():
        raise ValueError(f"image must be in the range of float32, got {np.abs(known).max()}")
    if suffix == ".npy":
        np.save(path, exact)
    else:
        path.write_bytes(encoded_exr(exact.reshape(pixels.shape), "linear light, by qmcjax"))


def read_image(path: str | PathLike[str], *, transfer: str | None = None) -> NDArray[np.float32]:
    """Read an image of linear light from a file.

    Parameters
    ----------
    path : path
        Ends in ``.exr``, ``.npy`` or ``.png``.
    transfer : {"srgb", "linear"}, optional
        Transfer of the values of a PNG file, see :func:`write_image`. Not needed if the file states it, and
        must not contradict the file.

    Returns
    -------
    float32 array, shape (height, width) or (height, width, channels)
        Linear light: 3 channels, or 4 with alpha; grey with alpha has 2.

    Raises
    ------
    ValueError
        If the file holds something else, is damaged or is not finite: names the file and, if known, the
        place. If neither a PNG file nor ``transfer`` states the transfer.
    ImportError
        For EXR files with tiles, or with a compression other than ZIP, without the package ``OpenEXR``, which
        ``pip install 'qmcjax[exr]'`` installs. The package does not detect all damage.
    """
    path = checks.path(path)
    suffix = suffix_of(path, _KNOWN)
    transfer = None if transfer is None else checks.choice("transfer", transfer, _TRANSFERS)
    if transfer is not None and suffix != ".png":
        raise ValueError(f"transfer must be None except for PNG files, got {transfer!r}")
    try:
        pixels = _light(path, suffix, transfer)
        if not np.isfinite(pixels).all():
            row, column, *_ = map(int, np.argwhere(~np.isfinite(pixels))[0])
            raise ValueError(f"row {row}, column {column}, must be finite, got {pixels[row, column]}")
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None
    return pixels[..., 0] if pixels.shape[2:] == (1,) else pixels


def _light(path: Path, suffix: str, transfer: str | None) -> NDArray[np.float32]:
    if suffix == ".exr":
        return read_exr(path)
    data = path.read_bytes()
    if suffix == ".png":
        return _decoded(decoded(data), transfer)
    array = parsed_npy(data)
    if array.dtype.kind != "f" or array.dtype.itemsize > 4 or array.ndim not in (2, 3) or not array.size:
        raise ValueError(
            f"must hold float32 of shape (height, width) or (height, width, channels), got {array.dtype} "
            f"{array.shape}"
        )
    return array.astype(np.float32)


def _decoded(png: Png, transfer: str | None) -> NDArray[np.float32]:
    says = "srgb" if png.srgb else "linear" if png.gamma == 1 else None
    if says is None and transfer is None:
        what = "nothing" if png.gamma is None else f"the exponent {png.gamma}"
        raise ValueError(f"transfer must be given, for the file says {what} of its values")
    if says and transfer and says != transfer:
        raise ValueError(f"transfer must be {says!r}, as the file says, got {transfer!r}")
    values = png.pixels / float(np.iinfo(png.pixels.dtype).max)
    if (says or transfer) == "srgb":
        colours = 1 if values.shape[2] < 3 else 3
        values[..., :colours] = _light_of_srgb(values[..., :colours])
    return values.astype(np.float32)


def _srgb_of(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sRGB values of light in [0, 1] (IEC 61966-2-1)."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def _light_of_srgb(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
