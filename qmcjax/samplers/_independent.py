"""The same sequence in every pixel, randomised independently, or interleaved over tiles."""

from collections.abc import Callable
from dataclasses import field, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_pair, owen_hash, reverse, to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import FEW, Fits, Sampler, joined, more_samples
from qmcjax.samplers._kinds import InEveryPixel
from qmcjax.samplers._of_functions import as_sampler
from qmcjax.sequences import BinarySequence, Sequence, SequenceLike, as_sequence

Randomizer = Callable[[Sequence, Array, int, Array, DTypeLike], Array]
Dims = int | tuple[int, ...]
"""One coordinate, or several stacked last, each with its seed."""


def _owen(sequence: BinarySequence, sample: Array, dims: Dims, seed: Array, dtype: DTypeLike) -> Array:
    return to_unit(reverse(owen_hash(sequence.fraction(sample, dims).bit_reversed(), seed)), dtype)


def _xor(sequence: BinarySequence, sample: Array, dims: Dims, seed: Array, dtype: DTypeLike) -> Array:
    return to_unit(reverse(sequence.fraction(sample, dims).bit_reversed() ^ seed), dtype)


def _shift(sequence: Sequence, sample: Array, dim: int, seed: Array, dtype: DTypeLike) -> Array:
    return sequence.rotated_coordinate(sample, dim, seed, dtype)


_RANDOMIZERS: dict[str, Callable[..., Array]] = {"owen": _owen, "shift": _shift, "xor": _xor}


@frozen_pytree
class Independent(InEveryPixel):
    """The points of a sequence, randomised with a seed for each pixel and coordinate."""

    sequence: Sequence
    seeds: Array
    """uint32 (dims, 2)."""
    randomizer: Randomizer = field(metadata={"static": True})

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> tuple[Array, ...]:
        return tuple(hash_pair(x ^ self.seeds[j, 0], y ^ self.seeds[j, 1]) for j in dims)

    def points(
        self, state: tuple[Array, ...], sample: Array, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        if len(dims) > FEW and self.randomizer is not _shift:
            of_all: Callable[..., Array] = self.randomizer
            return of_all(self.sequence, sample, dims, jnp.stack(state, axis=-1), dtype)
        seeds = zip(dims, state, strict=True)
        values = [self.randomizer(self.sequence, sample, j, seed, dtype) for j, seed in seeds]
        return jnp.stack(values, axis=-1)


def independent(sequence: SequenceLike, key: Array | int, randomize: str = "owen") -> Independent:
    """Sample every pixel with the first points of a sequence, randomised independently per pixel.

    Parameters
    ----------
    sequence : Sequence, with ``bits``; any sequence for "shift"
    key : jax.random.key, or int in [0, 2**32)
    randomize : {"owen", "xor", "shift"}
        Owen scrambling by hashing, xor with a random word (a digital shift), or a random shift modulo 1 (a
        Cranley-Patterson rotation [2]_) for sequences that are uniform on the torus, like lattices. The sum
        is exact in base 2; for other sequences it is rounded once from float64, never to 1.

    Notes
    -----
    Each sample of each pixel is uniform over keys, including the first.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error
       via Hierarchical Ordering of Pixels", 2020, Sect. 4 (the (0,2)-sequence sampler it compares with).
    .. [2] R. Cranley, T. N. L. Patterson, "Randomization of Number Theoretic Methods for Multiple
       Integration", SIAM J. Numer. Anal. 13, 1976.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.independent(sequences.sobol(2), key=0)
    >>> print(sampler(0, 0, 1).shape, bool((sampler(0, 0, 1) == sampler(1, 0, 1)).any()))
    (2,) False
    """
    checks.choice("randomize", randomize, sorted(_RANDOMIZERS))
    if randomize == "shift":
        sequence = as_sequence("sequence", sequence)
    elif not isinstance(sequence, BinarySequence):
        raise TypeError(
            f"sequence must be in base 2 (one that has .bits) for randomize={randomize!r}, "
            f"got {checks.shown(sequence)}"
        )
    seeds = draws.bits(checks.prng_key("key", key), (sequence.dims, 2), jnp.uint32)
    return Independent(sequence, seeds, _RANDOMIZERS[randomize])


_ON_SCREEN = 2


@frozen_pytree
class Interleaved(Sampler):
    """The pixels of a tile take consecutive blocks of the sequence; all tiles are equal."""

    sequence: Sequence
    spp: int = field(metadata={"static": True})
    tile: int = field(metadata={"static": True})
    positions: Sampler | None
    """The sampler of the position inside the pixel, or None."""

    @property
    def dims(self) -> int:
        return self.sequence.dims + self._on_screen

    @property
    def _on_screen(self) -> int:
        return 0 if self.positions is None else _ON_SCREEN

    @property
    def fits(self) -> Fits:
        own = Fits(spp=self.spp, why="samples in the block of a pixel")
        of = own if self.positions is None else self.positions.fits
        return own._replace(size=of.size) if own.spp <= of.spp else of

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        tile = np.uint32(self.tile)
        first = (y % tile * tile + x % tile) * np.uint32(self.spp)
        own = tuple(j for j in dims if j < self._on_screen)
        return first, self.positions.prepare(x, y, own) if self.positions and own else None

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        first, of_positions = state
        own = tuple(j for j in dims if j < self._on_screen)
        shared = tuple(j - self._on_screen for j in dims if j >= self._on_screen)
        parts = []
        if self.positions and own:
            parts.append(self.positions.points(of_positions, sample, own, dtype))
        if shared:
            parts.append(self.sequence.coordinates(first + sample, shared, dtype))
        return joined(parts, (*own, *(j + self._on_screen for j in shared)), dims)

    def finer(self, count: int) -> "Interleaved":
        spp = more_samples(self.spp, count, self.sequence.limit // self.tile**2)
        return replace(self, spp=spp, positions=self.positions and self.positions.finer(count))

    def check(self, width: int, height: int, spp: int) -> None:
        if self.positions is not None:
            self.positions.check(width, height, spp)
        super().check(width, height, spp)


def interleaved(
    sequence: SequenceLike, spp: int, tile: int = 1, positions: Sampler | None = None
) -> Interleaved:
    """Sample all tiles of the image with the same points, the pixels of a tile with blocks of one sequence.

    For renderers that render whole images at one time, or with one vector of all coordinates but the pixel
    [1]_ [2]_:

    - ``tile=1``: every pixel has the same points, as in an accumulation buffer.
    - ``tile=1`` with ``positions``: only the position inside the pixel differs (the method of dependent
      tests). Each sample shows a ghost of a moving object (strobing).
    - a larger ``tile``: interleaved sampling. Neighbouring pixels have different points, which turns ghosts
      into a fine pattern.

    Parameters
    ----------
    sequence : Sequence
        The shared coordinates: all, or with ``positions`` those after the first two. At least
        ``tile**2 * spp`` points.
    spp : int, points in the block of a pixel, at least 1
    tile : int, side of a tile in pixels, at least 1
    positions : Sampler, optional, coordinates 0 and 1; at least two dimensions

    Notes
    -----
    Each sample of a pixel is uniform over keys if each point of the sequence, and of ``positions``, is.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.1.2 and 3.1.3.
    .. [2] A. Keller, W. Heidrich, "Interleaved Sampling", 2001.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.interleaved(sequences.van_der_corput(), spp=4, tile=2)
    >>> print([sampler(x, 0, 0, dims=(0,)).item() for x in range(4)])
    [0.0, 0.125, 0.0, 0.125]
    """
    spp = checks.integer("spp", spp, 1, 2**32 - 1)
    tile = checks.integer("tile", tile, 1, 2**16)
    sequence = as_sequence("sequence", sequence)
    limit = sequence.limit
    if tile * tile * spp > limit:
        raise ValueError(f"spp must be at most {limit // tile**2} for tiles of {tile} x {tile}, got {spp}")
    if positions is not None:
        positions = as_sampler("positions", positions)
        if positions.dims < _ON_SCREEN:
            raise ValueError(f"positions must have at least 2 coordinates, got {positions.dims}")
    return Interleaved(sequence, spp, tile, positions)
