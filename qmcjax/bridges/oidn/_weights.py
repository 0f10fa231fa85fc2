"""The weights of Open Image Denoise, read from its library."""

import struct
from functools import cache
from importlib import metadata, util
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array

Weights = dict[str, Array]

_PARAMETERS = (
    *(914627, 3841475, 914627, 316579, 917219, 318307, 919811, 320035, 919811, 320035, 3848387),
    *(914627, 316579, 917219, 318307, 919811, 320035, 919811, 320035, 914627, 3841475, 914627, 914627),
)
"""Of the networks in the library, in its order."""


@cache
def networks() -> tuple[Weights, ...]:
    package = util.find_spec("pyoidn")
    if package is None or package.origin is None:
        raise ImportError("Open Image Denoise is not installed: pip install 'qmcjax[oidn]'")
    files = sorted(Path(package.origin).parent.glob("oidn/*/*OpenImageDenoise_core*"))
    networks = _read(files[0].read_bytes()) if files else ()
    counts = tuple(sum(each.size for each in network.values()) for network in networks)
    if counts != _PARAMETERS:
        raise ValueError(
            "pyoidn must have the networks of Open Image Denoise 2.5 (pip install pyoidn==2.5.1.0), got "
            f"version {metadata.version('pyoidn')} with {sum(counts)} parameters in {len(counts)} networks "
            f"instead of {sum(_PARAMETERS)} in {len(_PARAMETERS)}"
        )
    return networks


def _read(data: bytes) -> tuple[Weights, ...]:
    """Return the tensors, by name, of each network in a library.

    Each begins with a signature, 0x41D7, the version, 2.0, and the offset of a table of tensors: their name,
    shape, layout, type and offset.
    """
    signature = b"\xd7\x41\2\0"
    start, networks = data.find(signature), []
    while start >= 0:
        (table,) = struct.unpack_from("<Q", data, start + 4)
        at = start + table
        if at < len(data):  # Else the signature came by chance.
            networks.append(_tensors(data, start, at))
        start = data.find(signature, start + 4)
    return tuple(networks)


def _tensors(data: bytes, start: int, at: int) -> Weights:
    (count,) = struct.unpack_from("<I", data, at)
    at += 4
    tensors = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name, rank = data[at + 2 : at + 2 + length].decode(), data[at + 2 + length]
        at += 3 + length
        shape = struct.unpack_from(f"<{rank}I", data, at)
        kind, offset = struct.unpack_from("<cQ", data, at + 5 * rank)  # The layout has a letter an axis.
        at += 5 * rank + 9
        values = np.frombuffer(data, {b"f": "<f4", b"h": "<f2"}[kind], int(np.prod(shape)), start + offset)
        tensors[name] = jnp.asarray(values.reshape(shape).astype(np.float32))
    return tensors
