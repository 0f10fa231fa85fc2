"""PNG with 8 or 16 bits per channel, in and out, and its metadata.

Pillow reads 16 bits of one channel only; tables need all bits of all channels.
"""

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._exr import DEFLATES

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}
"""Channels of the types grey, RGB, grey with alpha, RGB with alpha."""


@dataclass(frozen=True)
class Png:
    """A decoded file."""

    pixels: NDArray
    """uint8 or uint16 (height, width, channels)."""
    texts: dict[str, str]
    """Text chunks, by keyword."""
    gamma: float | None
    """Exponent of the transfer from light to values, if the file has one."""
    srgb: bool
    """Whether it declares sRGB values."""


def encoded(pixels: NDArray, texts: dict[str, str], transfer: str | None = None) -> bytes:
    """Return the bytes of a PNG file.

    ``pixels``: uint8 or uint16 array, shape (height, width, channels). ``texts``: Latin-1 text by keyword.
    ``transfer``: the transfer that the file declares.
    """
    height, width, channels = pixels.shape
    kind = {n: k for k, n in _CHANNELS.items()}[channels]
    head = struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, kind, 0, 0, 0)
    rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    # No filter: neighbouring points in tables are unrelated.
    lines = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    says = {
        None: [],
        "srgb": [(b"sRGB", b"\0"), (b"gAMA", struct.pack(">I", 45455))],
        "linear": [(b"gAMA", struct.pack(">I", 100000))],
    }[transfer]
    words = [
        (b"tEXt", keyword.encode("latin1") + b"\0" + text.encode("latin1")) for keyword, text in texts.items()
    ]
    chunks = [(b"IHDR", head), *says, *words, (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b"")]
    return _SIGNATURE + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks
    )


def decoded(data: bytes) -> Png:
    """Decode a PNG file, or raise a ValueError that begins with the invalid byte."""
    if not data.startswith(_SIGNATURE):
        raise ValueError(f"byte 0, must be a PNG file, got {data[:8]!r}")
    name, body, place = _chunk(data, len(_SIGNATURE))
    width, height, depth, channels = _head(name, body, len(_SIGNATURE))
    packed, texts, gamma, srgb = b"", {}, None, False
    while name != b"IEND":
        at = place
        name, body, place = _chunk(data, at)
        if name == b"IDAT":
            packed += body
        elif name == b"tEXt":
            keyword, _, text = body.partition(b"\0")
            texts[keyword.decode("latin1")] = text.decode("latin1")
        elif name == b"gAMA" and len(body) == 4:
            gamma = int.from_bytes(body, "big") / 1e5
        elif name == b"sRGB":
            srgb = True
        elif name != b"IEND" and not name[0] & 32:
            raise ValueError(f"byte {at}, must be a chunk of an image without a palette, got {name!r}")
    stride = width * channels * depth // 8
    wanted, most = (stride + 1) * height, DEFLATES * len(packed)
    if wanted > most:
        raise ValueError(f"byte {len(_SIGNATURE)}, must have {wanted} bytes of pixels, got at most {most}")
    try:
        inflater = zlib.decompressobj()
        lines = inflater.decompress(packed, wanted + 1)
    except zlib.error as error:
        raise ValueError(f"byte {len(_SIGNATURE)}, must have compressed pixels: {error}") from None
    if len(lines) != wanted:
        raise ValueError(f"byte {len(_SIGNATURE)}, must have {wanted} bytes of pixels, got {len(lines)}")
    rows = np.frombuffer(lines, np.uint8).reshape(height, stride + 1)
    if rows[:, 0].max() > 4:
        row = int(np.argmax(rows[:, 0] > 4))
        raise ValueError(f"row {row}, must have a filter below 5, got {rows[row, 0]}")
    values = _unfiltered(rows[:, 0], rows[:, 1:].reshape(height, -1, channels * depth // 8))
    pixels = values.reshape(height, stride).view(np.uint8 if depth == 8 else ">u2")
    native = pixels.astype(np.uint8 if depth == 8 else np.uint16).reshape(height, width, channels)
    return Png(native, texts, gamma, srgb)


def _chunk(data: bytes, at: int) -> tuple[bytes, bytes, int]:
    """Return the name and body of a chunk, and the start of the next one."""
    size = int.from_bytes(data[at : at + 4], "big")
    end = at + 12 + size
    if end > len(data):
        raise ValueError(f"byte {at}, must be a whole chunk, got {len(data) - at} of {12 + size} bytes")
    name, body = data[at + 4 : at + 8], data[at + 8 : end - 4]
    if zlib.crc32(name + body) != int.from_bytes(data[end - 4 : end], "big"):
        raise ValueError(f"byte {at}, must be a chunk with its checksum, got another one for {name!r}")
    return name, body, end


def _head(name: bytes, body: bytes, at: int) -> tuple[int, int, int, int]:
    if name != b"IHDR" or len(body) != 13:
        raise ValueError(f"byte {at}, must be the first chunk of a PNG file, got {name!r}")
    width, height, depth, kind, *methods = struct.unpack(">IIBBBBB", body)
    if kind not in _CHANNELS or depth not in (8, 16) or any(methods) or not width or not height:
        raise ValueError(
            f"byte {at}, must be an image of 8 or 16 bits without palette or interlacing, got {width} x "
            f"{height}, {depth} bits, type {kind}, methods {methods}"
        )
    return width, height, depth, _CHANNELS[kind]


def _unfiltered(filters: NDArray[np.uint8], differences: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Undo the filters of rows: each byte had a prediction from the left and upper bytes subtracted.

    A byte depends on those left, above, and left above; the bytes of a diagonal are computed at once.
    """
    height, width, size = differences.shape
    if not filters.any():
        return differences
    done = np.zeros((height + 1, width + 1, size), np.int16)
    for diagonal in range(height + width - 1):
        y = np.arange(max(0, diagonal - width + 1), min(height, diagonal + 1))
        x = diagonal - y
        left, above, corner = done[y + 1, x], done[y, x + 1], done[y, x]
        estimate = left + above - corner
        away = [np.abs(estimate - each) for each in (left, above, corner)]
        paeth = np.where(
            (away[0] <= away[1]) & (away[0] <= away[2]), left, np.where(away[1] <= away[2], above, corner)
        )
        kinds = [np.zeros_like(left), left, above, (left + above) >> 1, paeth]
        predicted = np.choose(filters[y][:, None], kinds)
        done[y + 1, x + 1] = (differences[y, x] + predicted) & 255
    return done[1:, 1:].astype(np.uint8)
