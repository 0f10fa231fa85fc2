"""One net over the whole screen: each pixel takes the points that fall into it."""

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax import checks
from qmcjax.bits import to_unit
from qmcjax.orders import MAX_SIDE, log_side
from qmcjax.pytrees import pytree
from qmcjax.samplers._base import Sampler, check_count, check_size
from qmcjax.sequences import Digital, framed


@runtime_checkable
class Invertible(Protocol):
    """A point set in base 2 that knows the indices of its points in a cell of a raster."""

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        ...

    @property
    def size(self) -> int | None:
        """Number of points, None if each further sample takes a further frame of a sequence."""
        ...

    def word(self, index: Array, dim: int) -> Array:
        """Return one coordinate as a 32-bit fraction."""
        ...

    def points_per_cell(self, log_side: int) -> int:
        """Return how many points each cell of a raster of ``2**log_side`` cells a side holds."""
        ...

    def index_in_cell(self, x: Array, y: Array, log_side: int, sample: Array) -> Array:
        """Return the index of a cell's point."""
        ...


@pytree
@dataclass(frozen=True)
class Screen(Sampler):
    """A net stretched over the smallest square with a power of two as side that covers the image."""

    net: Invertible
    width: int = field(metadata={"static": True})
    height: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        return self.net.dims

    @property
    def log_side(self) -> int:
        """Binary logarithm of the side of the padded raster."""
        return log_side(self.width, self.height)

    @property
    def spp(self) -> int:
        """Number of points of the net in each pixel."""
        return self.net.points_per_cell(self.log_side)

    def _values(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        index = self.net.index_in_cell(x, y, self.log_side, sample)
        # The leading bits of the first two coordinates are the pixel: shifted out, what is left has
        # its full precision at any resolution.
        words = [self.net.word(index, j) << (self.log_side if j < 2 else 0) for j in dims]
        return jnp.stack([to_unit(word, dtype) for word in words], axis=-1)

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise a ValueError unless this is the image, and the number of samples, of the net."""
        check_size("net", (self.width, self.height), (width, height))
        if self.net.size is None:
            check_count(spp, self.spp, "for this sequence and image")
        elif spp != self.spp:
            raise ValueError(f"spp must be {self.spp}, the net's points in a pixel of this image, got {spp}")


def screen(net: Invertible | Digital, width: int, height: int) -> Screen:
    """Sample the whole screen with one net, each pixel with the points that fall into it.

    The index of a point follows from its pixel by inverting the net on integers, without tables.

    Parameters
    ----------
    net : sequence in base 2
        One that can be inverted: a digital sequence, or one that has ``index_in_cell``. With ``2**k`` the
        smallest power of two that covers the image, a net of ``2**m`` points puts ``2**(m - 2 k)`` into
        every pixel, and a digital (0,2)-sequence one point in each frame of ``4**k`` points.
    width, height : int
        In [1, 65536].

    Returns
    -------
    Screen
        ``spp`` is the number of points in a pixel: of a net the only number of samples that it can be
        rendered with, of a sequence the largest.

    Raises
    ------
    ValueError
        If a size is out of range, or the net does not put equally many points into each pixel.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 and 5.2.5.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.screen(sequences.larcher_pillichshammer_net(20), 256, 256)
    >>> print(sampler.spp, sampler(255, 255, 15))
    16 [0.96875    0.33325195]
    """
    width, height = checks.integer("width", width, 1, MAX_SIDE), checks.integer("height", height, 1, MAX_SIDE)
    if isinstance(net, Digital):
        net = framed(net, log_side(width, height))
    if not isinstance(net, Invertible):
        raise ValueError(f"net must be invertible (have index_in_cell), got {net!r}")
    net.points_per_cell(log_side(width, height))
    return Screen(net, width, height)
