"""EXR files of one image in scanlines, in and out; other files by the package ``OpenEXR``.

For damaged chunks the package (3.3 to 3.5) prints a warning and returns uninitialized memory. Here they are
errors: ZIP has checksums, and our own files have one over all pixels.
"""

import struct
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_MAGIC = struct.pack("<II", 20000630, 2)
_NAMES = {1: "Y", 3: "RGB", 4: "RGBA"}
_LINES = {0: 1, 2: 1, 3: 16}
"""Lines per chunk, by compression: none, ZIPS and ZIP, which differ only in that."""

_ZIP = 3
DEFLATES = 1032
"""Maximum compression ratio of ZIP."""

_CHECKSUM = "qmcjaxCrc32"


class _Header(NamedTuple):
    width: int
    height: int
    top: int
    compression: int
    dtype: np.dtype
    """A field for each channel, in alphabetical order."""
    checksum: int | None
    end: int


def encoded_exr(pixels: NDArray[np.float32], words: str) -> bytes:
    """Return the bytes of a file: shape (height, width, channels), 1, 3 or 4 of them, with a comment."""
    height, width, count = pixels.shape
    names = sorted(_NAMES[count])
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name.encode() + struct.pack("<x4i", 2, 0, 1, 1) for name in names) + b"\0"
    ordered = pixels[..., [_NAMES[count].index(name) for name in names]]
    lines = np.ascontiguousarray(ordered.transpose(0, 2, 1), "<f4").view(np.uint8).reshape(height, -1)
    attributes = [
        ("channels", "chlist", channels),
        ("comments", "string", words.encode()),
        ("compression", "compression", bytes([_ZIP])),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        (_CHECKSUM, "int", struct.pack("<I", zlib.crc32(lines.tobytes()))),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]
    head = _MAGIC + b"".join(
        f"{name}\0{kind}\0".encode() + struct.pack("<i", len(body)) + body for name, kind, body in attributes
    )
    firsts = range(0, height, _LINES[_ZIP])
    chunks = []
    for y in firsts:
        raw = lines[y : y + _LINES[_ZIP]].ravel()
        packed = zlib.compress(_predicted(raw).tobytes())
        body = packed if len(packed) < raw.size else raw.tobytes()
        chunks.append(struct.pack("<2i", y, len(body)) + body)
    sizes = [len(head) + 1 + 8 * len(chunks), *map(len, chunks[:-1])]
    return head + b"\0" + np.cumsum(sizes).astype("<u8").tobytes() + b"".join(chunks)


def read_exr(path: Path) -> NDArray[np.float32]:
    """Return pixels of shape (height, width, channels), or raise a ValueError that begins with the place."""
    data = path.read_bytes()
    if data[:4] != _MAGIC[:4] or len(data) < 8:
        raise ValueError(f"byte 0, must be an EXR file, got {data[:8]!r}")
    header = _header(data) if data[4:8] == _MAGIC[4:] else None
    return _read_by_package(path) if header is None else _decoded(data, header)


def _header(data: bytes) -> _Header | None:
    """Return the relevant fields of a header; None for a compression that is not supported here."""
    attributes, place = {}, 8
    while data[place : place + 1] != b"\0":
        parts = data[place : place + 512].split(b"\0", 2)
        start = place + len(parts[0]) + len(parts[1]) + 6 if len(parts) == 3 else len(data) + 1
        size = int.from_bytes(data[start - 4 : start], "little", signed=True)
        if size < 0 or start + size > len(data):
            raise ValueError(f"byte {place}, must be an attribute of an EXR file, got {data[place:][:40]!r}")
        attributes[parts[0]] = data[start : start + size]
        place = start + size
    try:
        left, top, right, bottom = struct.unpack("<4i", attributes[b"dataWindow"])
        (compression,) = attributes[b"compression"]
        dtype = _dtype(attributes[b"channels"], right - left + 1)
        crc = attributes.get(_CHECKSUM.encode())
        if bottom < top or right < left:
            raise ValueError("a window")
        checksum = None if crc is None else struct.unpack("<I", crc)[0]
    except (KeyError, ValueError, TypeError, struct.error):
        raise ValueError("byte 8, must have channels, a compression and a data window") from None
    if compression not in _LINES:
        return None
    return _Header(right - left + 1, bottom - top + 1, top, compression, dtype, checksum, place + 1)


def _dtype(channels: bytes, width: int) -> np.dtype:
    """Return the dtype of a line: channels one after the other."""
    fields = []
    while channels != b"\0":
        name, rest = channels.split(b"\0", 1)
        kind, _, across, down = struct.unpack("<4i", rest[:16])
        if kind not in (1, 2) or (across, down) != (1, 1):
            raise ValueError("channels of floats")
        fields.append((name.decode("latin1"), "<f2" if kind == 1 else "<f4", (width,)))
        channels = rest[16:]
    return np.dtype(fields)


def _decoded(data: bytes, header: _Header) -> NDArray[np.float32]:
    lines, raw = _LINES[header.compression], header.dtype.itemsize
    count = -(-header.height // lines)
    if raw * header.height > DEFLATES * len(data):
        raise ValueError(f"byte 8, must be a window of {len(data)} bytes, got {raw * header.height} unpacked")
    if len(data) < header.end + 8 * count:
        raise ValueError(f"byte {header.end}, must be places of {count} chunks, got the end of the file")
    offsets = np.frombuffer(data, "<u8", count, header.end).tolist()
    found = np.empty(header.height, header.dtype)
    for chunk, place in enumerate(offsets):
        first = chunk * lines
        wanted = min(lines, header.height - first)
        head = data[place : place + 8]
        y, size = struct.unpack("<2i", head) if len(head) == 8 else (None, -1)
        body = data[place + 8 : place + 8 + max(size, 0)]
        if y != header.top + first or len(body) != size:
            raise ValueError(f"byte {place}, must be the chunk of line {header.top + first}, got {head!r}")
        if size != wanted * raw:
            body = _inflated(body, wanted * raw, place)
        found[first : first + wanted] = np.frombuffer(body, header.dtype)
    crc = zlib.crc32(found.tobytes())
    if header.checksum not in (None, crc):
        raise ValueError(f"byte {header.end}, must be pixels with their checksum, got {crc:08x}")
    return _chosen({name: found[name] for name in header.dtype.names or ()})


def _inflated(body: bytes, size: int, place: int) -> bytes:
    try:
        flat = zlib.decompressobj().decompress(body, size + 1)
        # Read the whole stream, so that its checksum is compared.
        if len(flat) != size or zlib.decompress(body) != flat:
            raise zlib.error(f"{len(flat)} bytes for {size}")
    except zlib.error as error:
        raise ValueError(f"byte {place}, must be a compressed chunk: {error}") from None
    return _unpredicted(np.frombuffer(flat, np.uint8)).tobytes()


def _predicted(raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return bytes with even places first, as differences plus 128 of neighbours."""
    split = np.concatenate([raw[0::2], raw[1::2]])
    split[1:] = split[1:] - split[:-1] + np.uint8(128)
    return split


def _unpredicted(flat: NDArray[np.uint8]) -> NDArray[np.uint8]:
    steps = flat - np.uint8(128)
    steps[:1] = flat[:1]
    split, half = np.cumsum(steps, dtype=np.uint8), -(-flat.size // 2)
    raw = np.empty_like(flat)
    raw[0::2], raw[1::2] = split[:half], split[half:]
    return raw


def _chosen(channels: dict[str, NDArray]) -> NDArray[np.float32]:
    """Return the channels of an image as its last axis."""
    for names in ("RGBA", "RGB", "Y"):
        if all(name in channels for name in names):
            return np.stack([channels[name] for name in names], axis=-1).astype(np.float32)
    raise ValueError(f"must have the channels RGB, RGBA or Y, got {sorted(channels)}")


def _read_by_package(path: Path) -> NDArray[np.float32]:
    """Read other compressions, tiles, and the first image of files with several."""
    try:
        import OpenEXR  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError(
            f"path must be an EXR file of scanlines, uncompressed or ZIP, without the package OpenEXR "
            f"(pip install 'qmcjax[exr]'), got {path}"
        ) from None
    package: Any = OpenEXR
    try:
        with package.File(str(path), separate_channels=True) as file:
            found = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # RuntimeError, UnicodeDecodeError, ...
        raise ValueError(f"must be a whole EXR file: {error}") from None
    if any(pixels.dtype.kind != "f" for pixels in found.values()):
        raise ValueError(f"must have channels of floats, got {sorted(found)}")
    return _chosen(found)
