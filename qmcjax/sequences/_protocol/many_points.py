"""Points in memory, made many at a time, with large pages."""

import os
import re
import sys
from collections.abc import Callable

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

_CHUNK = 2**21
"""Bytes made at a time: they stay in the cache of the processor."""

_LARGE = 2**25
"""Bytes from which the allocator always returns new memory."""

_ALIGNMENT = 64
"""Alignment in bytes of NumPy arrays that JAX can use without a copy."""

ROWS = 256
"""Number of rows that divides the starts of chunks."""


def materialize(make: Callable[[int, int], Array], n: int, dims: int, dtype: np.dtype) -> Array:
    """Return rows 0 to n - 1 of ``make(first, count)``.

    The first access to a new 4 KiB page costs more than the arithmetic of most sequences. NumPy requests
    large pages from the kernel; XLA does so only with ``GLIBC_TUNABLES=glibc.malloc.hugetlb=1``. So large
    results on the CPU are made in chunks that stay in its cache, and copied into a NumPy array that JAX uses
    without a copy.
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
