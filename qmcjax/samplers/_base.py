"""The interface of a sampler: from a pixel and the number of a sample to a point."""

import abc
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import pytree


class Sampler(abc.ABC):
    """A function from pixel and sample to the point that the sample is taken at.

    Coordinates 0 and 1 of the point are the position inside the pixel, the others are the scene's.
    Subclasses are frozen dataclass pytrees that implement ``dims``, :meth:`_values` and, where they are
    made for one image or a number of samples, :meth:`check`.
    """

    @property
    @abc.abstractmethod
    def dims(self) -> int:
        """Number of coordinates that can be asked for."""

    @abc.abstractmethod
    def _values(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the wanted coordinates, shape ``x.shape + (len(dims),)``."""

    def __call__(
        self,
        x: Array | int,
        y: Array | int,
        sample: Array | int,
        dims: tuple[int, ...] = (0, 1),
        dtype: DTypeLike = jnp.float32,
    ) -> Array:
        """Return the points of the given pixels and samples.

        Parameters
        ----------
        x, y, sample : uint32 Array, broadcastable, or int
            Column, row, and number of the sample in the pixel.
        dims : tuple of int
            The wanted coordinates, static; only these are computed.
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, the broadcast shape + (len(dims),), in [0, 1)

        Raises
        ------
        ValueError
            If an argument is not uint32, or a coordinate is not there.
        """
        wanted = checks.dimensions(dims, self.dims)
        x, y, sample = jnp.broadcast_arrays(
            checks.unsigned("x", x), checks.unsigned("y", y), checks.unsigned("sample", sample)
        )
        return self._values(x, y, sample, wanted, checks.floating(dtype))

    def of_pixels(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the sampler of some pixels alone, with what is the same for all their samples computed.

        For loops over samples, like those of :func:`qmcjax.render`: a compiler that could move the position
        on a curve, for instance, out of the loop does not, lest the memory it takes be too much.

        Parameters
        ----------
        x, y : uint32 Array, of one shape
        dims : tuple of int
            The coordinates that will be asked for, static.

        Returns
        -------
        Sampler
            To be called with the same x, y and dims, and any sample. By default ``self``.
        """
        return self

    def unrolled(self, dims: tuple[int, ...]) -> int:
        """Return how many samples such a loop best takes together, a power of two.

        Parameters
        ----------
        dims : tuple of int
            The coordinates that will be asked for.

        Returns
        -------
        int
            More are faster while compilers still vectorise the program.
        """
        return 8 if len(dims) <= 2 else 2

    def samples(
        self, x: Array, y: Array, block: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> list[Array]:
        """Return the samples ``block * count``, ``block * count + 1``, ... of some pixels.

        For loops over samples that unroll a few of them.

        Parameters
        ----------
        x, y : uint32 Array, of one shape
        block : uint32 Array, shape ()
        count : int
            How many.
        dims : tuple of int
        dtype : float32 or float64

        Returns
        -------
        list of Array of ``dtype``, shape ``x.shape + (len(dims),)``
        """
        first = block * np.uint32(count)
        numbers = [jnp.broadcast_to(first + np.uint32(i), x.shape) for i in range(count)]
        return [self._values(x, y, number, dims, dtype) for number in numbers]

    @abc.abstractmethod
    def check(self, width: int, height: int, spp: int) -> None:
        """Raise a ValueError unless an image of this size and number of samples can be made."""


@pytree
@dataclass(frozen=True)
class PlugIn(Sampler):
    """An object with ``dims``, ``check`` and a sampler's call."""

    sampler: Any

    @property
    def dims(self) -> int:
        """Number of coordinates that can be asked for."""
        return self.sampler.dims

    def _values(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return self.sampler(x, y, sample, dims, dtype)

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise a ValueError unless an image of this size and number of samples can be made."""
        self.sampler.check(width, height, spp)


def completed(sampler: Any) -> Sampler:
    """Give any object that is a sampler the methods that have defaults."""
    return sampler if isinstance(sampler, Sampler) else PlugIn(sampler)


def check_size(name: str, made_for: tuple[int, int], wanted: tuple[int, int]) -> None:
    """Raise a ValueError if a sampler made for one image size is used for another."""
    if made_for != wanted:
        raise ValueError(
            f"width, height must be the {name}'s {made_for[0]} x {made_for[1]}, got {wanted[0]} x {wanted[1]}"
        )


def check_count(spp: int, limit: int, why: str) -> None:
    """Raise a ValueError if more samples are wanted than there are."""
    if spp > limit:
        raise ValueError(f"spp must be at most {limit} {why}, got {spp}")
