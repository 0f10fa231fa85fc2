"""Damaged files, and the memory that refusing them takes."""

import tracemalloc

import numpy as np
import pytest

CORRUPTED = 200
"""Of each kind of file."""


def corrupted(data, rng):
    """Return bytes with one fault: cut, one bit flipped, some bytes changed, taken away, or put in."""
    at, length = int(rng.integers(len(data))), int(rng.integers(1, 9))
    anything = rng.integers(0, 256, length, np.uint8).tobytes()
    return (
        data[:at],
        data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :],
        data[:at] + anything + data[at + length :],
        data[: at + 1] + data[at + 1 + length :],
        data[:at] + anything + data[at:],
    )[rng.integers(5)]


def peak(call):
    """Return the most bytes that Python and NumPy held during a call that raises a ValueError, and it."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError) as raised:
            call()
        return tracemalloc.get_traced_memory()[1], str(raised.value)
    finally:
        tracemalloc.stop()
