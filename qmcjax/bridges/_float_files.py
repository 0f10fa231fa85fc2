"""Images of floats without a library: PFM files [1]_ and Radiance's HDR files [2]_.

References
----------
.. [1] P. Debevec, "Portable FloatMap image format", 2000.
.. [2] G. Ward, "Real pixels", Graphics Gems II, 1991.
"""

import math
import re

import numpy as np
from numpy.typing import NDArray

_PFM = re.compile(rb"(P\S)\s+(\d{1,9})\s+(\d{1,9})\s+([-+]?)([\d.]+(?:[eE][-+]?\d+)?)(?:\r?\n|\s)")

_HDR = re.compile(rb"#\?(?:RADIANCE|RGBE)[^\n]*\n((?:[^\n]+\n)*)\n([^\n]*)\n")
_SIZE = re.compile(rb"-Y +(\d{1,9}) +\+X +(\d{1,9})\s*")
_FORMAT = b"32-bit_rle_rgbe"

_PIECES = re.compile(rb"((.)\2{3,126})|(?:(.)(?!\3{3})){1,128}", re.DOTALL)
"""Runs of a byte, and others."""

_WIDTHS = range(8, 2**15)
"""Of rows that may be packed."""


def encode_pfm(pixels: NDArray[np.float32]) -> bytes:
    """Return a PFM file of pixels of shape (height, width, channels), 1 or 3 of them."""
    height, width, channels = pixels.shape
    head = f"{'PF' if channels == 3 else 'Pf'}\n{width} {height}\n-1.0\n"
    return head.encode() + pixels[::-1].astype("<f4").tobytes()


def decode_pfm(data: bytes) -> NDArray[np.float32]:
    """Return pixels of shape (height, width, channels), in units of the file's scale; NaN is let through."""
    head = _PFM.match(data)
    if head is None or head[1] not in (b"PF", b"Pf"):
        raise ValueError(f"byte 0, must be PF or Pf, width, height and scale, got {data[:20]!r}")
    width, height, channels = int(head[2]), int(head[3]), 3 if head[1] == b"PF" else 1
    order, scale = "<f4" if head[4] == b"-" else ">f4", _factor(head[5])
    size = 4 * width * height * channels
    if not size or len(data) != head.end() + size:
        what = f"{width} x {height} pixels of {channels} floats, {size} bytes"
        raise ValueError(f"byte {head.end()}, must be {what}, got {len(data) - head.end()} bytes")
    pixels = np.frombuffer(data, order, offset=head.end()).reshape(height, width, channels)[::-1]
    with np.errstate(over="ignore", invalid="ignore"):
        return pixels.astype(np.float32) if scale == 1 else (pixels * np.float64(scale)).astype(np.float32)


def encode_hdr(pixels: NDArray[np.float32]) -> bytes:
    """Return an HDR file of pixels of shape (height, width, 3), rounded to nearest.

    Mantissas that round to 256 become 255, to be within 1/256 of the brightest channel, too.
    """
    for wrong, what in ((pixels < 0, "at least 0"), (pixels >= 2.0**127, "below 2**127")):
        if wrong.any():
            row, column, channel = map(int, np.argwhere(wrong)[0])
            place = f"{pixels[row, column, channel]} in row {row}, column {column}"
            raise ValueError(f"image must be {what} for HDR files, got {place}")
    height, width, _ = pixels.shape
    brightest = pixels.max(axis=-1, keepdims=True)
    exponents = np.frexp(brightest)[1]  # brightest / 2**exponent is in [1/2, 1)
    mantissas = np.minimum(np.rint(np.ldexp(pixels.astype(np.float64), 8 - exponents)), 255)
    words = np.concatenate([mantissas, exponents + 128.0], axis=-1)
    rgbe = np.where(brightest >= 2.0**-128, words, 0).astype(np.uint8)
    head = f"#?RADIANCE\nSOFTWARE=qmcjax\nFORMAT={_FORMAT.decode()}\n\n-Y {height} +X {width}\n".encode()
    if width not in _WIDTHS:
        return head + rgbe.tobytes()
    mark = bytes([2, 2, *divmod(width, 256)])
    rows = (mark + b"".join(_packed(channel.tobytes()) for channel in row.T) for row in rgbe)
    return head + b"".join(rows)


def _packed(line: bytes) -> bytes:
    return b"".join(
        bytes([128 + len(piece[0]), piece[0][0]]) if piece[1] else bytes([len(piece[0])]) + piece[0]
        for piece in _PIECES.finditer(line)
    )


def decode_hdr(data: bytes) -> NDArray[np.float32]:
    """Return pixels of shape (height, width, 3), without the exposure that the head states."""
    head = _HDR.match(data)
    if head is None:
        raise ValueError(f"byte 0, must be the head of a Radiance HDR file, got {data[:20]!r}")
    factors = np.ones(1)
    for line in head[1].splitlines():
        name, _, value = line.partition(b"=")
        if name == b"FORMAT" and value.strip() != _FORMAT:
            raise ValueError(f"byte 0, must have the format {_FORMAT.decode()}, got {value.decode('latin1')}")
        if name in (b"EXPOSURE", b"COLORCORR"):
            given = [_factor(word) for word in value.split()]
            if len(given) not in (1, 3):
                raise ValueError(f"byte 0, must have 1 or 3 factors as {name.decode()}, got {len(given)}")
            factors = factors * given
    size = _SIZE.fullmatch(head[2])
    if size is None or not int(size[1]) * int(size[2]):
        found = head[2].decode("latin1")
        raise ValueError(
            f"byte {head.start(2)}, must be -Y height +X width, rows from the top, got {found!r}"
        )
    height, width, at, rows = int(size[1]), int(size[2]), head.end(), []
    for row in range(height):
        try:
            line, at = _row(data, at, width)
        except IndexError:
            raise ValueError(f"row {row}, must be one of {height} x {width} pixels, got the end") from None
        except ValueError as error:
            raise ValueError(f"row {row}, {error}") from None
        rows.append(line)
    if at != len(data):
        raise ValueError(f"byte {at}, must be the end after {height} rows, got {len(data) - at} bytes")
    rgbe = np.stack(rows)
    exponents = rgbe[..., 3:].astype(np.int32)
    light = np.where(exponents, np.ldexp(rgbe[..., :3].astype(np.float64), exponents - 136), 0)
    with np.errstate(over="ignore"):
        return (light / factors).astype(np.float32)


def _row(data: bytes, at: int, width: int) -> tuple[NDArray[np.uint8], int]:
    """Return the pixels (width, 4) of the row that begins at a byte, and the byte after it."""
    if width not in _WIDTHS or data[at : at + 2] != b"\2\2" or data[at + 2] >= 128:
        line = np.frombuffer(data[at : at + 4 * width], np.uint8)
        if len(line) < 4 * width:
            raise IndexError
        pixels = line.reshape(width, 4)
        if (pixels[:, :3] == 1).all(axis=1).any():
            raise ValueError("must not have the run-length encoding before Radiance 2.0, got a pixel of it")
        return pixels, at + 4 * width
    if data[at + 2] * 256 + data[at + 3] != width:
        raise ValueError(f"must have {width} pixels, got {data[at + 2] * 256 + data[at + 3]}")
    at, line = at + 4, bytearray()
    for end in range(width, 5 * width, width):
        while len(line) < end:
            count = data[at]
            if count > 128:
                line += data[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                line += data[at + 1 : at + 1 + count]
                at += 1 + count
            if not count or len(line) > end:
                raise ValueError(f"must have runs that end with {width} pixels, got the code {count}")
    return np.frombuffer(bytes(line), np.uint8).reshape(4, width).T, at


def _factor(word: bytes) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise ValueError(
            f"byte 0, must have factors that are positive and finite, got {word.decode('latin1')}"
        )
    return value
