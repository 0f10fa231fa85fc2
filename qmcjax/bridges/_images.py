"""Image files: PNG by pypng, NumPy arrays, and what other modules encode."""

import io
import struct
import zlib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from jax.typing import ArrayLike
from numpy.typing import NDArray

from qmcjax.bridges._exr import read_exr, write_exr
from qmcjax.bridges._float_files import decode_hdr, decode_pfm, encode_hdr, encode_pfm
from qmcjax.core import checks, tables
from qmcjax.samplers import blue_noise_mask

_KNOWN = (".exr", ".hdr", ".npy", ".pfm", ".png")
_SHAPES = "(height, width) or (height, width, 3)"

DEFLATES = 1032
"""Maximum compression ratio of ZIP: pixels are unpacked no further than the head of a PNG file says."""

_TRANSFERS = {
    "srgb": [(b"sRGB", b"\0"), (b"gAMA", struct.pack(">I", 45455))],
    "linear": [(b"gAMA", struct.pack(">I", 100000))],
    None: [],
}
"""Chunks of PNG that declare the transfer from light to values."""


def write_image(
    path: str | PathLike[str],
    image: ArrayLike,
    *,
    transfer: str | None = None,
    bits: int = 8,
    dither: bool = False,
) -> None:
    """Write an image, such as the result of :func:`qmcjax.render`, to a file.

    The file is replaced when the new one is complete.

    Parameters
    ----------
    path : path
        Ends in ``.npy``, ``.pfm`` or ``.exr`` (``pip install 'qmcjax[exr]'``), for any float32 values, in
        ``.hdr``, for values in [0, 2**127), or in ``.png``, for values in [0, 1].
    image : float ArrayLike, shape (height, width) or (height, width, 3), finite linear light
    transfer : {"srgb", "linear"}
        Required for PNG files, which store it: sRGB values, which programs display unchanged, or linear
        light. None for other files.
    bits : {8, 16}
        Per channel of a PNG file. Values are clamped to [0, 1].
    dither : bool
        Whether values of a PNG file are rounded up or down by the thresholds of
        :func:`qmcjax.samplers.blue_noise_mask`, such that their mean is right, in linear light: 128 x 128
        pixels of one colour have its mean to 2**-15 of a step. All channels have the same thresholds, so grey
        stays grey. Otherwise values are rounded to nearest, and smooth gradients have bands.

    Notes
    -----
    Radiance's HDR files have three channels, of a grey image equal ones, and a common exponent: errors are at
    most 1/256 of the brightest channel of the pixel. Values below 2**-128 become 0.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/grey.png", [[0.0, 0.5, 1.0]], transfer="srgb", bits=16)
    ...     print(read_image(f"{folder}/grey.png"))
    [[0.        0.5000088 1.       ]]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/dark.png", np.full((128, 128), 0.001), transfer="srgb", dither=True)
    ...     print(f"{read_image(f'{folder}/dark.png').mean():.7f}")
    0.0010000
    """
    path = checks.path(path)
    suffix = checks.suffix_of(path, _KNOWN)
    known = checks.known_array("image", image, np.floating, f"floats of shape {_SHAPES}")
    if known.ndim not in (2, 3) or not known.size or known.shape[2:] not in ((), (3,)):
        raise ValueError(f"image must have the shape {_SHAPES}, got {known.shape}")
    known = known.astype(np.float64)
    if not np.isfinite(known).all():
        row, column, *_ = map(int, np.argwhere(~np.isfinite(known))[0])
        raise ValueError(f"image must be finite, got {known[row, column]} in row {row}, column {column}")
    pixels, dither = known.reshape(*known.shape[:2], -1), checks.flag("dither", dither)
    if suffix == ".png":
        transfer = checks.choice("transfer", transfer, ("srgb", "linear"))
        if checks.integer("bits", bits, 8, 16) not in (8, 16):
            raise ValueError(f"bits must be 8 or 16, got {bits}")
        levels = _levels(np.clip(pixels, 0, 1), 2**bits - 1, transfer, dither)
        whole = levels.astype(np.uint8 if bits == 8 else np.uint16)
        write_bytes(path, encode_png(whole, {"Software": "qmcjax"}, transfer))
        return
    for name, given, default in (("transfer", transfer, None), ("dither", dither, False)):
        if given is not default:
            raise ValueError(f"{name} must be {default} except for PNG files, got {checks.shown(given)}")
    with np.errstate(over="ignore"):
        exact = known.astype(np.float32)
    if not np.isfinite(exact).all():
        raise ValueError(f"image must be in the range of float32, got {np.abs(known).max()}")
    channels = exact.reshape(pixels.shape)
    if suffix == ".npy":
        file = io.BytesIO()
        np.save(file, exact)
        write_bytes(path, file.getvalue())
    elif suffix == ".pfm":
        write_bytes(path, encode_pfm(channels))
    elif suffix == ".hdr":
        write_bytes(path, encode_hdr(np.broadcast_to(channels, (*exact.shape[:2], 3))))
    else:
        write_exr(path, channels, "linear light, by qmcjax")


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file completely or, after any exception, leave it as it was."""
    with tables.replaced(path) as temporary:
        temporary.write_bytes(data)


def _levels(light: NDArray, top: int, transfer: str, dither: bool) -> NDArray:
    """Return levels in [0, top] of a PNG file for light in [0, 1], shape (height, width, channels)."""
    values = light
    if transfer == "srgb":  # IEC 61966-2-1
        values = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    if not dither:
        return np.rint(values * top)
    low = np.minimum(np.floor(values * top), top - 1)
    below, above = low / top, (low + 1) / top
    if transfer == "srgb":
        below, above = _light(below), _light(above)
    mask = blue_noise_mask(1)
    rows, columns = (np.arange(size) % len(mask) for size in light.shape[:2])
    return low + (light - below > mask[rows][:, columns, None] * (above - below))


def _light(values: NDArray) -> NDArray:
    """Return the linear light of values of sRGB."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def read_image(
    path: str | PathLike[str], *, transfer: str | None = None, layer: str | None = None
) -> NDArray[Any]:
    """Read an image of linear light, or another layer of an EXR file.

    Parameters
    ----------
    path : path
        Ends in ``.exr``, ``.hdr``, ``.npy``, ``.pfm`` or ``.png``.
    transfer : {"srgb", "linear"}, optional
        Transfer function of a PNG file, see :func:`write_image`. Not needed if the file states it, and must
        not contradict the file.
    layer : str, optional
        What to read of an EXR file: a layer, such as ``"ViewLayer.Combined"`` or ``"ViewLayer.Depth"`` of
        Blender's files, or a channel, such as ``"ViewLayer.Depth.Z"`` or ``"id"``. In files of several parts,
        their names come first unless channels repeat them. The beginning up to a dot may be left out if what
        remains occurs once. By default, the colours outside of layers of the first part, or of the only layer
        that has some.

    Returns
    -------
    float32 array, shape (height, width) or (height, width, channels)
        Linear light: 3 channels, or 4 with alpha; grey with alpha has 2. Of an EXR file, the channels RGBA,
        RGB, Y, XYZW, XYZ, UV or XY of a layer, or its only one, in the display window, 0 around the data
        window. Integer channels are uint32, and have to be named. PFM files are multiplied by the
        magnitude of their scale, HDR files divided by the exposure that they state, as their authors mean it.

    Raises
    ------
    ValueError
        If the file has other contents, is damaged or has non-finite values; the message names the file and,
        if known, the place. If neither a PNG file nor ``transfer`` states the transfer function. If an EXR
        file has no such layer, or several that ``layer`` may mean; the message lists all.
    ImportError
        For EXR files without the package ``OpenEXR``, which ``pip install 'qmcjax[exr]'`` installs.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/light.hdr", [[[0.1, 1.0, 100.0]]])
    ...     print(read_image(f"{folder}/light.hdr"))
    [[[  0.   1. 100.]]]
    """
    path = checks.path(path)
    suffix = checks.suffix_of(path, _KNOWN)
    transfer = None if transfer is None else checks.choice("transfer", transfer, ("srgb", "linear"))
    if layer is not None and not isinstance(layer, str):
        raise TypeError(f"layer must be the name of a layer or None, got {checks.shown(layer)}")
    for name, given, only in (("transfer", transfer, ".png"), ("layer", layer, ".exr")):
        if given is not None and suffix != only:
            raise ValueError(f"{name} must be None except for {only[1:].upper()} files, got {given!r}")
    with tables.named(path):
        pixels = read_exr(path).pick(layer) if suffix == ".exr" else _read_light(path, suffix, transfer)
        if not np.isfinite(pixels).all():
            row, column, *_ = map(int, np.argwhere(~np.isfinite(pixels))[0])
            raise ValueError(f"row {row}, column {column}, must be finite, got {pixels[row, column]}")
    return pixels[..., 0] if pixels.shape[2:] == (1,) else pixels


def _read_light(path: Path, suffix: str, transfer: str | None) -> NDArray[np.float32]:
    if suffix == ".png":
        return _light_of_png(path.read_bytes(), transfer)
    if suffix in (".hdr", ".pfm"):
        return (decode_hdr if suffix == ".hdr" else decode_pfm)(path.read_bytes())
    array = tables.load(path, 2**63)
    if array.dtype.kind != "f" or array.dtype.itemsize > 4 or array.ndim not in (2, 3) or not array.size:
        raise ValueError(
            f"must contain float32 of shape (height, width) or (height, width, channels), got {array.dtype} "
            f"{array.shape}"
        )
    return array.astype(np.float32)


def read_mask(path: str | PathLike[str]) -> NDArray[np.float64]:
    """Read a mask, such as published blue noise, for :func:`qmcjax.samplers.dither` from a PNG file.

    Parameters
    ----------
    path : path
        A PNG file with 8 or 16 bits per channel.

    Returns
    -------
    float64 array, shape (rows, columns) or (rows, columns, channels)
        In (0, 1): level k of 256 is (k + 1/2) / 256, whatever transfer function the file states.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_image(f"{folder}/mask.png", [[0.0, 1.0]], transfer="linear")
    ...     print(256 * read_mask(f"{folder}/mask.png"))
    [[  0.5 255.5]]
    """
    path = checks.path(path)
    checks.suffix_of(path, (".png",))
    with tables.named(path):
        levels, _, _ = decode_png(path.read_bytes())
    mask = (levels + 0.5) / 2.0 ** (8 * levels.itemsize)
    return mask[..., 0] if mask.shape[2] == 1 else mask


def encode_png(pixels: NDArray, texts: Mapping[str, str], transfer: str | None = None) -> bytes:
    """Return a PNG file of uint8 or uint16 pixels, shape (height, width, channels), and of Latin-1 texts."""
    import png  # pyright: ignore[reportMissingImports]

    height, width, channels = pixels.shape
    plain, file = io.BytesIO(), io.BytesIO()
    how = {"greyscale": channels < 3, "alpha": channels in (2, 4), "bitdepth": 8 * pixels.itemsize}
    rows = pixels.astype(pixels.dtype.newbyteorder(">"))
    png.Writer(width, height, compression=9, **how).write_packed(plain, [row.tobytes() for row in rows])
    head, *rest = png.Reader(bytes=plain.getvalue()).chunks()
    words = [(b"tEXt", f"{keyword}\0{text}".encode("latin1")) for keyword, text in texts.items()]
    png.write_chunks(file, [head, *_TRANSFERS[transfer], *words, *rest])
    return file.getvalue()


def decode_png(data: bytes) -> tuple[NDArray, float | None, bool]:
    """Return the pixels of a PNG file, as :func:`encode_png` takes them, its gamma, and whether it is sRGB.

    A ValueError begins with the place.
    """
    import png  # pyright: ignore[reportMissingImports]

    names, packed, place = [], b"", 0
    try:
        for name, body in png.Reader(bytes=data).chunks():
            place = place or 8
            if not name[0] & 32 and name not in (b"IHDR", b"IDAT", b"IEND", b"PLTE"):
                raise png.FormatError(f"chunk {name!r} is unknown")
            names.append(name)
            packed += body if name == b"IDAT" else b""
            place += 12 + len(body)
        place = 8
        width, height, rows, info = png.Reader(bytes=data).read()
        if "palette" in info or info["interlace"] or info["bitdepth"] not in (8, 16):
            raise png.FormatError("it has others")
        size = height * (1 + width * info["planes"] * info["bitdepth"] // 8)
        too_large = size > DEFLATES * len(packed)
        if too_large or len(zlib.decompressobj().decompress(packed, size + 1)) != size:
            raise png.FormatError(f"it must have {size} bytes of pixels")
        dtype = np.uint8 if info["bitdepth"] == 8 else np.uint16
        pixels = np.stack([np.frombuffer(row, dtype) for row in rows])
    except (png.Error, zlib.error, EOFError) as error:
        what = f"must be an image of 8 or 16 bits without palette or interlacing: {error.args[0]}"
        raise ValueError(f"byte {place}, {what}") from None
    return pixels.reshape(height, width, info["planes"]), info.get("gamma"), b"sRGB" in names


def _light_of_png(data: bytes, transfer: str | None) -> NDArray[np.float32]:
    pixels, gamma, srgb = decode_png(data)
    says = "srgb" if srgb else "linear" if gamma == 1 else None
    if says is None and transfer is None:
        what = "nothing" if gamma is None else f"the exponent {gamma}"
        raise ValueError(f"transfer must be given, since the file states {what} about its values")
    if says and transfer and says != transfer:
        raise ValueError(f"transfer must be {says!r}, as the file states, got {transfer!r}")
    values = pixels / float(np.iinfo(pixels.dtype).max)
    if (says or transfer) == "srgb":
        colours = values[..., : 1 if values.shape[2] < 3 else 3]
        colours[:] = _light(colours)
    return values.astype(np.float32)
