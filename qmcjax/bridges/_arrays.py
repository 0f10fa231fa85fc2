"""Suffixes of files, and arrays in NumPy formats; errors name the byte."""

import io
import warnings
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import checks


def suffix_of(path: Path, known: Iterable[str]) -> str:
    """Return the suffix of a path in lower case, or raise a ValueError if it is unknown."""
    suffix = path.suffix.lower()
    if suffix not in known:
        raise ValueError(f"path must end in one of {', '.join(known)}, got {checks.shown(str(path))}")
    return suffix


def read_npy(data: bytes) -> NDArray:
    """Return the array of a ``.npy`` file, which must end after it."""
    file = io.BytesIO(data)
    try:
        with warnings.catch_warnings(action="error"):
            array = np.lib.format.read_array(file, allow_pickle=False)
    except Exception as error:  # ValueError, MemoryError, SyntaxError, UserWarning, ...
        raise ValueError(f"byte {file.tell()}, must be a whole .npy file: {error}") from None
    if file.read(1):
        raise ValueError(f"byte {len(data)}, must end after {file.tell() - 1} bytes, got {len(data)}")
    return array


def read_npz(data: bytes, max_bytes: int) -> dict[str, NDArray]:
    """Return the arrays of a ``.npz`` file with matching checksums; see :func:`read_npy`.

    Sizes in the directory are checked before unpacking, and limit it.
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
            arrays[name] = read_npy(content)
        except ValueError as error:
            raise ValueError(f"array {name!r}, {error}") from None
    return arrays
