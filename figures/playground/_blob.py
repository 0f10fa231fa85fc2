"""Arrays one after the other, as bytes that compress well, behind a description in JSON."""

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Place = list[int]
"""Where an array begins and ends."""


class Blob:
    """The bytes of arrays; equal ones are kept once."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._known: dict[bytes, Place] = {}

    def planes(self, numbers: NDArray[Any], count: int) -> Place:
        """Add whole numbers of ``count`` bytes: the lowest bytes of all first, then the next."""
        words = numbers.astype(np.uint32)
        return self._add(b"".join((words >> (8 * k)).astype(np.uint8).tobytes() for k in range(count)))

    def floats(self, numbers: NDArray[np.float64]) -> Place:
        """Add floats as they are."""
        return self._add(numbers.astype("<f8").tobytes())

    def _add(self, data: bytes) -> Place:
        if data not in self._known:
            self._known[data] = [len(self._data), len(self._data) + len(data)]
            self._data += data
        return self._known[data]

    def packed(self, described: Mapping[str, Any]) -> str:
        """Return base64 of what is compressed: the length of the JSON in 4 bytes, the JSON, the arrays."""
        head = json.dumps(described, separators=(",", ":")).encode()
        data = len(head).to_bytes(4, "little") + head + self._data
        return base64.b64encode(zlib.compress(data, 9)).decode()
