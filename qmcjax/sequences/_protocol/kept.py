"""Points that are kept: many at a time, in memory with large pages."""

import os
import re
import sys
from collections.abc import Callable

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

_CHUNK = 2**21
"""Bytes made at a time: what stays in a processor's cache, while the next ones are made."""

_LARGE = 2**25
"""Bytes from which memory is always new, never what an earlier array left behind."""

_ALIGNMENT = 64
"""Bytes that an array of NumPy's is aligned to when JAX can take it over as it is."""

ROWS = 256
"""Chunks start at multiples of so many rows."""


def kept(make: Callable[[int, int], Array], n: int, dims: int, dtype: np.dtype) -> Array:
    """Return rows 0 to n - 1 of ``make(first, count)``.

    The first touch of a new 4 KiB page costs more than most sequences' arithmetic. NumPy asks the kernel
    for large pages, the memory of XLA's results comes without them unless the environment asks
    (``GLIBC_TUNABLES=glibc.malloc.hugetlb=1``). So large results on the CPU are made in chunks that stay
    in its cache, and copied into an array of NumPy's that JAX takes over.
    """
    row = dims * np.dtype(dtype).itemsize
    count = max(_CHUNK // row // ROWS, 1) * ROWS
    if n * row < _LARGE or n <= count or sys.platform != "linux" or _large_pages():
        return make(0, n)
    chunk = make(0, count)
    if isinstance(chunk, Tracer) or any(device.platform != "cpu" for device in chunk.devices()):
        return make(0, n)
    rows = _aligned((n, dims), dtype)
    for first in range(0, n, count):
        done, following = chunk, first + count
        if following < n:
            chunk = make(following, min(count, n - following))
        rows[first:following] = np.asarray(done)[: n - first]
    return jax.device_put(rows)


def _large_pages() -> bool:
    return re.search(r"glibc\.malloc\.hugetlb=[12]", os.environ.get("GLIBC_TUNABLES", "")) is not None


def _aligned(shape: tuple[int, int], dtype: np.dtype) -> np.ndarray:
    size = shape[0] * shape[1] * np.dtype(dtype).itemsize
    memory = np.empty(size + _ALIGNMENT, np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size].view(dtype).reshape(shape)
