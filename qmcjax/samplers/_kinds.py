"""What kinds of samplers share: one sequence in every pixel, any dimensions, one image size, an order."""

import abc
from dataclasses import dataclass, field
from typing import Any

from qmcjax.core import checks
from qmcjax.orders import Order, log_side
from qmcjax.samplers._base import Sampler
from qmcjax.sequences import Sequence


class InEveryPixel(Sampler):
    """A sampler with the first points of one sequence in every pixel, randomised or shifted."""

    sequence: Any

    _limited = "for this sequence"

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def limits(self) -> tuple[int, int, int]:
        return (*super().limits[:2], self.sequence.limit)


@dataclass(frozen=True, eq=False, repr=False)
class OfDims(Sampler):
    """A sampler with any number of dimensions."""

    coordinates: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.coordinates


class OnRaster(Sampler):
    """A sampler for one image size, which it pads to a raster."""

    _sized = "sampler"
    """Name of the object with this size, for error messages."""

    @property
    @abc.abstractmethod
    def _size(self) -> tuple[int, int]:
        """Width and height of the image."""

    @property
    @abc.abstractmethod
    def raster(self) -> tuple[int, int]:
        """Columns and rows of the raster."""

    @property
    def most(self) -> int:
        """Largest number of samples per pixel."""
        return self.spp  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def limits(self) -> tuple[int, int, int]:
        return (*self.raster, self.most)

    def check(self, width: int, height: int, spp: int) -> None:
        checks.image_size(width, height)
        if self._size != (width, height):
            wanted = "{} x {}".format(*self._size)
            raise ValueError(f"width, height must be the {self._sized}'s {wanted}, got {width} x {height}")
        super().check(width, height, spp)


@dataclass(frozen=True, eq=False, repr=False)
class ForImage(OnRaster):
    """A sampler that pads an image to the smallest enclosing square with a power of two as side."""

    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})

    @property
    def _size(self) -> tuple[int, int]:
        return self.width, self.height

    @property
    def log_side(self) -> int:
        """Binary logarithm of the side of the square."""
        return log_side(self.width, self.height)

    @property
    def raster(self) -> tuple[int, int]:
        return 2**self.log_side, 2**self.log_side


@dataclass(frozen=True, eq=False, repr=False)
class AlongCurve(OnRaster):
    """A sampler that assigns the points of a sequence to the pixels along an order."""

    order: Order
    sequence: Sequence

    _sized = "order"

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def _size(self) -> tuple[int, int]:
        return self.order.width, self.order.height

    @property
    def raster(self) -> tuple[int, int]:
        return self.order.raster
