"""What kinds of samplers share: one sequence in every pixel, any dimensions, one image size, an order."""

from dataclasses import dataclass, field
from typing import Any

from qmcjax.orders import Order, log_side
from qmcjax.samplers._base import Fits, Sampler
from qmcjax.sequences import Sequence


class InEveryPixel(Sampler):
    """A sampler with the first points of one sequence in every pixel, randomised or shifted."""

    sequence: Any

    @property
    def dims(self) -> int:
        return self.sequence.dims

    @property
    def fits(self) -> Fits:
        return Fits(spp=self.sequence.limit, why="for this sequence")


@dataclass(frozen=True, eq=False, repr=False)
class OfDims(Sampler):
    """A sampler with any number of dimensions."""

    coordinates: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.coordinates


@dataclass(frozen=True, eq=False, repr=False)
class ForImage(Sampler):
    """A sampler that pads an image to the smallest enclosing square with a power of two as side."""

    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})

    @property
    def fits(self) -> Fits:
        return Fits((self.width, self.height))

    @property
    def log_side(self) -> int:
        """Binary logarithm of the side of the square."""
        return log_side(self.width, self.height)


@dataclass(frozen=True, eq=False, repr=False)
class AlongCurve(Sampler):
    """A sampler that assigns the points of a sequence to the pixels along an order."""

    order: Order
    sequence: Sequence

    @property
    def dims(self) -> int:
        return self.sequence.dims

    def _fits(self, spp: int, why: str) -> Fits:
        return Fits((self.order.width, self.order.height), spp, why=why)
