"""Suffixes of files, and arrays in NumPy's formats; errors name the byte."""

import ast
import io
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks

_MAGIC = b"\x93NUMPY"
_KEYS = {"descr", "fortran_order", "shape"}


def suffix_of(path: Path, known: Iterable[str]) -> str:
    """Return the suffix of a path in lower case, or raise a ValueError if it is unknown."""
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"path must end in one of {', '.join(known)}, got {checks.shown(str(path))}")
    return suffix


def parsed_npy(data: bytes) -> NDArray:
    """Return the array of a ``.npy`` file, or raise a ValueError that begins with a place.

    Like ``numpy.load``, but nothing is unpickled, and nothing may follow the array.
    """
    if data[:6] != _MAGIC or data[6:7] not in (b"\x01", b"\x02", b"\x03"):
        raise ValueError(f"byte 0, must begin as a .npy file of version 1, 2 or 3, got {data[:8]!r}")
    width = 2 if data[6] == 1 else 4
    first = 8 + width
    end = first + int.from_bytes(data[8:first], "little")
    if end > len(data):
        raise ValueError(f"byte 8, must be the size of the header, got {end - first} of {len(data)} bytes")
    dtype, shape, fortran = _header(data[first:end], first)
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if len(data) != end + size:
        raise ValueError(f"byte {len(data)}, must end after {end + size} bytes, got {len(data)}")
    return np.frombuffer(data, dtype, offset=end).reshape(shape, order="F" if fortran else "C")


def _header(text: bytes, first: int) -> tuple[np.dtype, tuple[int, ...], bool]:
    try:
        header = ast.literal_eval(text.decode("latin1").strip())
        if not isinstance(header, dict) or set(header) != _KEYS:
            raise ValueError(f"a dictionary of {sorted(_KEYS)}")
        shape = header["shape"]
        if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
            raise ValueError("a shape")
        if not isinstance(header["fortran_order"], bool) or not isinstance(header["descr"], str):
            raise ValueError("an order and a dtype")
        dtype = np.dtype(header["descr"])
        if dtype.hasobject:
            raise ValueError("a dtype without objects")
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        # literal_eval and dtype raise all of these, for invalid Python and invalid dtypes.
        raise ValueError(f"byte {first}, must be the header of an array, got {text[:60]!r}") from None
    return dtype, shape, header["fortran_order"]


def parsed_npz(data: bytes, max_bytes: int) -> dict[str, NDArray]:
    """Return the arrays of a ``.npz`` file with matching checksums; see :func:`parsed_npy`.

    Sizes in the directory are checked before anything is unpacked, and limit what is unpacked.
    """
    arrays = {}
    place = max(data.rfind(b"PK\x05\x06"), 0)  # the directory, at the end
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(member.file_size for member in archive.infolist())
            if size > max_bytes:
                raise ValueError(f"they must take at most max_bytes={max_bytes}, got {size} bytes unpacked")
            for member in archive.infolist():
                place = max(member.header_offset, 0)
                if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise ValueError(f"they must be stored or deflated, got method {member.compress_type}")
                with archive.open(member) as content:
                    arrays[member.filename.removesuffix(".npy")] = content.read(member.file_size)
    except Exception as error:  # BadZipFile, zlib.error, EOFError, struct.error, RuntimeError, ...
        raise ValueError(f"byte {place}, must be an archive of arrays: {error}") from None
    for name, content in arrays.items():
        try:
            arrays[name] = parsed_npy(content)
        except ValueError as error:
            raise ValueError(f"array {name!r}, {error}") from None
    return arrays
