"""Image files: EXR by the package OpenEXR, PNG by pypng, and NumPy arrays."""

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

from qmcjax.core import checks, tables

_KNOWN = (".exr", ".npy", ".png")
_SHAPES = "(height, width) or (height, width, 3)"

_EXR_CHANNELS = ("RGBA", "RGB", "Y")
_CHECKSUM = "qmcjaxCrc32"
"""Attribute of our EXR files: ZIP leaves chunks that do not become smaller without a checksum."""

DEFLATES = 1032
"""Maximum compression ratio of ZIP: pixels are unpacked no further than the head of a PNG file says."""

_TRANSFERS = {
    "srgb": [(b"sRGB", b"\0"), (b"gAMA", struct.pack(">I", 45455))],
    "linear": [(b"gAMA", struct.pack(">I", 100000))],
    None: [],
}
"""Chunks of PNG that declare the transfer from light to values."""


def write_image(
    path: str | PathLike[str], image: ArrayLike, *, transfer: str | None = None, bits: int = 8
) -> None:
    """Write an image, such as the result of :func:`qmcjax.render`, to a file.

    Parameters
    ----------
    path : path
        Ends in ``.npy`` or ``.exr`` (``pip install 'qmcjax[exr]'``), for any float32 values, or in ``.png``,
        for values in [0, 1].
    image : float ArrayLike, shape (height, width) or (height, width, 3), finite linear light
    transfer : {"srgb", "linear"}
        Required for PNG files, which store it: sRGB values, which programs display unchanged, or linear
        light. None for other files.
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
    suffix = checks.suffix_of(path, _KNOWN)
    known = checks.known_array("image", image, np.floating, f"floats of shape {_SHAPES}")
    if known.ndim not in (2, 3) or not known.size or known.shape[2:] not in ((), (3,)):
        raise ValueError(f"image must have the shape {_SHAPES}, got {known.shape}")
    known = known.astype(np.float64)
    if not np.isfinite(known).all():
        row, column, *_ = map(int, np.argwhere(~np.isfinite(known))[0])
        raise ValueError(f"image must be finite, got {known[row, column]} in row {row}, column {column}")
    pixels = known.reshape(*known.shape[:2], -1)
    if suffix == ".png":
        transfer = checks.choice("transfer", transfer, ("srgb", "linear"))
        if checks.integer("bits", bits, 8, 16) not in (8, 16):
            raise ValueError(f"bits must be 8 or 16, got {bits}")
        values = np.clip(pixels, 0, 1)
        if transfer == "srgb":  # IEC 61966-2-1
            values = np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)
        whole = np.rint(values * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
        path.write_bytes(encode_png(whole, {"Software": "qmcjax"}, transfer))
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
        write_exr(path, exact.reshape(pixels.shape), "linear light, by qmcjax")


def read_image(path: str | PathLike[str], *, transfer: str | None = None) -> NDArray[np.float32]:
    """Read an image of linear light from a file.

    Parameters
    ----------
    path : path
        Ends in ``.exr``, ``.npy`` or ``.png``.
    transfer : {"srgb", "linear"}, optional
        Transfer function of a PNG file, see :func:`write_image`. Not needed if the file states it, and must
        not contradict the file.

    Returns
    -------
    float32 array, shape (height, width) or (height, width, channels)
        Linear light: 3 channels, or 4 with alpha; grey with alpha has 2. Of an EXR file, the channels RGBA,
        RGB or Y in its display window, 0 around its data window.

    Raises
    ------
    ValueError
        If the file has other contents, is damaged or has non-finite values; the message names the file and,
        if known, the place. If neither a PNG file nor ``transfer`` states the transfer function.
    ImportError
        For EXR files without the package ``OpenEXR``, which ``pip install 'qmcjax[exr]'`` installs.
    """
    path = checks.path(path)
    suffix = checks.suffix_of(path, _KNOWN)
    transfer = None if transfer is None else checks.choice("transfer", transfer, ("srgb", "linear"))
    if transfer is not None and suffix != ".png":
        raise ValueError(f"transfer must be None except for PNG files, got {transfer!r}")
    try:
        pixels = _read_light(path, suffix, transfer)
        if not np.isfinite(pixels).all():
            row, column, *_ = map(int, np.argwhere(~np.isfinite(pixels))[0])
            raise ValueError(f"row {row}, column {column}, must be finite, got {pixels[row, column]}")
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None
    return pixels[..., 0] if pixels.shape[2:] == (1,) else pixels


def _read_light(path: Path, suffix: str, transfer: str | None) -> NDArray[np.float32]:
    if suffix == ".exr":
        return read_exr(path)
    if suffix == ".png":
        return _light_of_png(path.read_bytes(), transfer)
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
    try:
        levels, _, _ = decode_png(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path}, {error}") from None
    mask = (levels + 0.5) / 2.0 ** (8 * levels.itemsize)
    return mask[..., 0] if mask.shape[2] == 1 else mask


def write_exr(path: Path, pixels: NDArray[np.float32], comment: str) -> None:
    """Write pixels of shape (height, width, channels), 1, 3 or 4 of them."""
    package = _open_exr(path)
    names = next(names for names in _EXR_CHANNELS if len(names) == pixels.shape[2])
    channels = {name: np.ascontiguousarray(pixels[..., k]) for k, name in enumerate(names)}
    header = {
        "compression": package.ZIP_COMPRESSION,
        "type": package.scanlineimage,
        "comments": comment,
        _CHECKSUM: _checksum(channels),
    }
    path.touch()  # Raises an OSError if it cannot be written, where the package raises RuntimeErrors.
    with package.File(header, channels) as file:
        file.write(str(path))


def read_exr(path: Path) -> NDArray[np.float32]:
    """Return pixels of shape (height, width, channels): of the first image, if there are several."""
    with path.open("rb") as file:
        magic = file.read(4)
    if magic != struct.pack("<I", 20000630):
        raise ValueError(f"byte 0, must be an EXR file, got {magic!r}")
    package = _open_exr(path)
    try:
        with package.File(str(path), separate_channels=True) as file:
            # The package empties headers of closed files.
            announced, *corners = map(file.header().get, (_CHECKSUM, "dataWindow", "displayWindow"))
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # RuntimeError, UnicodeDecodeError, ...
        raise ValueError(f"byte 4, must be a whole EXR file: {error}") from None
    data, display = (np.array(corner, int) for corner in corners)  # (2, 2): first and last column and row
    size = (data[1] - data[0] + 1)[::-1]
    kept = {
        name for name, pixels in channels.items() if pixels.dtype.kind == "f" and pixels.shape == (*size,)
    }
    names = next((names for names in _EXR_CHANNELS if set(names) <= kept), None)
    if names is None or (names == "Y" and channels.keys() & {"RY", "BY"}):
        found = ", ".join(f"{name} {p.dtype} {p.shape}" for name, p in sorted(channels.items()))
        what = "floats of full resolution as channels RGBA, RGB, or Y without chroma RY and BY"
        raise ValueError(f"must have {what}, got {found}")
    low, high = data - display
    if (low < 0).any() or (high > 0).any():
        windows = " and ".join(str(window.tolist()) for window in (data, display))
        raise ValueError(f"must have its data window within its display window, got {windows}")
    pixels = np.zeros((*(display[1] - display[0] + 1)[::-1], len(names)), np.float32)
    crop = np.stack([channels[name] for name in names], axis=-1)
    pixels[low[1] :, low[0] :][: size[0], : size[1]] = crop
    found = _checksum({name: pixels[..., k] for k, name in enumerate(names)})
    if announced not in (None, found):
        raise ValueError(f"byte 4, must be pixels with their checksum, got {found}")
    return pixels


def _open_exr(path: Path) -> Any:
    try:
        import OpenEXR  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError(
            "path must end in .npy or .png without the package OpenEXR (pip install 'qmcjax[exr]'), got "
            f"{path}"
        ) from None
    return OpenEXR


def _checksum(channels: Mapping[str, NDArray[np.float32]]) -> int:
    """Return the CRC-32 of all lines, channel by channel, as an int32."""
    lines = np.stack([channels[name] for name in sorted(channels)], axis=1)
    return int(np.uint32(zlib.crc32(lines.astype("<f4").tobytes())).view(np.int32))


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
        colours[:] = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    return values.astype(np.float32)
