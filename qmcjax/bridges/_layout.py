"""The layout of a table of pixels, samples and coordinates in a texture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Layout:
    """Layers side by side and in rows: each is the tile, with coordinates of one sample as channels."""

    rows: int
    columns: int
    samples: int
    coordinates: int
    channels: int

    @property
    def groups(self) -> int:
        """Layers per sample."""
        return -(-self.coordinates // self.channels)

    @property
    def layers(self) -> int:
        """Layer ``sample * groups + g`` has the coordinates from ``channels * g`` on."""
        return self.samples * self.groups

    @property
    def across(self) -> int:
        """Layers in a row: a power of two, for a texture that is about square."""
        return 1 << (self.layers - 1).bit_length() // 2

    @property
    def width(self) -> int:
        """Columns of the texture."""
        return self.across * self.columns

    @property
    def height(self) -> int:
        """Rows of the texture."""
        return -(-self.layers // self.across) * self.rows

    def texels(self, values: NDArray) -> NDArray:
        """Return values, shape (rows, columns, samples, coordinates), as (height, width, channels).

        Unused texels are 0.
        """
        full = np.zeros((self.rows, self.columns, self.samples, self.groups * self.channels), values.dtype)
        full[..., : self.coordinates] = values
        split = full.reshape(self.rows, self.columns, self.layers, self.channels)
        down = self.height // self.rows
        layers = np.zeros((down * self.across, self.rows, self.columns, self.channels), values.dtype)
        layers[: self.layers] = split.transpose(2, 0, 1, 3)
        grid = layers.reshape(down, self.across, self.rows, self.columns, self.channels)
        return grid.transpose(0, 2, 1, 3, 4).reshape(self.height, self.width, self.channels)
