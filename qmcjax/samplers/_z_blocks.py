"""The Z-sampler: each pixel takes a block of a sequence; its order continues with the samples' digits."""

from dataclasses import field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import STEP, ScrambledMorton, morton
from qmcjax.samplers._along_curve import Index, needed
from qmcjax.samplers._base import FEW, Fits, Sampler, more_samples
from qmcjax.samplers._kinds import ForImage
from qmcjax.samplers._z_index import (
    Frames,
    Number,
    append,
    scrambled_group,
    scrambled_number,
    scrambled_numbers,
)
from qmcjax.sequences import BinarySequence

MAX_SPP = 2**31
"""Most samples per pixel: shifts of 32-bit words allow no more."""


@frozen_pytree
class Z(ForImage):
    """Pixel p in the order of a constituent takes points spp * p, ..., in its own order."""

    loops = True

    orders: ScrambledMorton | None
    """A family with one order per constituent; None for Z0, which uses Morton order for all."""
    sequence: BinarySequence
    """Each constituent has its first coordinates."""
    spp: int = field(metadata={"static": True})
    constituents: tuple[int, ...] = field(metadata={"static": True})
    rounds: int = field(default=1, metadata={"static": True})
    frames: Frames | None = None
    """Numbers of one frame, for each constituent."""
    squares: tuple[Array, Array] | None = None
    """For the first constituents, what the pixels of a square share: see :meth:`with_tables`."""

    @property
    def dims(self) -> int:
        return sum(self.constituents)

    @property
    def log_spp(self) -> int:
        return self.spp.bit_length() - 1

    def extended(self, rounds: int) -> "Z":
        """Continue after ``spp`` samples of a pixel, up to ``rounds * spp``.

        In round r (samples from ``r * spp`` on) the pixel at position p of an order takes the points of the
        pixel at position p xor r, in its own order: in round 1 two siblings swap their points. If ``rounds``
        is a power of two, a pixel has a contiguous aligned block of the sequence after the last round. The
        first round does not change.

        Parameters
        ----------
        rounds : int
            At least 1, at most as many as the padded raster has pixels, and ``rounds * spp < 2**32``.

        Returns
        -------
        Z

        Notes
        -----
        With a joint sequence, a pixel reuses the points of another one. Several constituents combine the
        points differently, since their orders differ. In both cases neighbours have similar errors in the
        rounds after the first: a larger ``spp`` is better than more rounds [1]_.

        References
        ----------
        .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
           Hierarchical Ordering of Pixels", 2020, Appendix A, third scenario.
        """
        most = min(4**self.log_side, (checks.INDEX_LIMIT - 1) // self.spp)
        return replace(self, rounds=checks.integer("rounds", rounds, 1, most))

    def adaptive(self, counts: ArrayLike) -> "AdaptiveZ":
        """Set a number of samples for each pixel.

        A pixel with c samples takes the samples of the sampler with ``spp=c`` and the same key. Errors are
        diffused among pixels with equal counts; between different counts, points may coincide [1]_.

        Parameters
        ----------
        counts : integer ArrayLike, shape (height, width)
            Powers of two in [1, spp]; ``counts[y, x]`` is for pixel (x, y). New counts do not recompile.

        Returns
        -------
        AdaptiveZ

        References
        ----------
        .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
           Hierarchical Ordering of Pixels", 2020, Appendix A, first scenario.
        """
        words = checks.unsigned("counts", counts)
        if words.shape != (self.height, self.width):
            raise ValueError(
                f"counts must be integers of shape {(self.height, self.width)}, got {words.shape}"
            )
        if not isinstance(words, Tracer):
            wrong = (words < 1) | (words > self.spp) | (jax.lax.population_count(words) != 1)
            if wrong.any():
                raise ValueError(
                    f"counts must be powers of two in [1, spp={self.spp}], got {int(words[wrong][0])}"
                )
        return AdaptiveZ(self, jnp.uint32(31) - jax.lax.clz(words))

    def finer(self, count: int) -> "Z":
        most = min(MAX_SPP // self.rounds, self.sequence.limit_64 // 4**self.log_side)
        return replace(self, spp=more_samples(self.spp, count, most, powers=True))

    @property
    def _places(self) -> list[tuple[int, int]]:
        """The constituent of each coordinate, and its number in it."""
        return [(c, j) for c, count in enumerate(self.constituents) for j in range(count)]

    @property
    def fits(self) -> Fits:
        return Fits((self.width, self.height), self.rounds * self.spp, why="samples of a pixel")

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        code = morton(self.width, self.height).unchecked_position(x, y)
        orders, squares = self.orders, self.squares
        if orders is None:
            return code

        def of_member(c: int | Array) -> tuple[Array, Array]:
            if squares is None:
                return orders.member(c).scrambled(code, self.log_side)
            return orders.member(c).inside((squares[0][c], squares[1][c]), x, y)

        wanted = self._wanted(dims)
        if len(wanted) > FEW // 2:
            return jax.lax.map(of_member, np.array(wanted, np.uint32))
        return {c: of_member(c) for c in wanted}

    def with_tables(self, dims: tuple[int, ...]) -> "Z":
        orders = self.orders
        if orders is None or self.log_side < STEP:
            return self
        members = np.arange(max(self._wanted(dims)) + 1, dtype=np.uint32)
        return replace(self, squares=jax.lax.map(lambda c: orders.member(c).squares(STEP), members))

    def _wanted(self, dims: tuple[int, ...]) -> list[int]:
        return sorted({self._places[j][0] for j in dims})

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return self.numbered(state, Number(sample), dims, dtype, self.log_spp)

    def unrolled(self, dims: tuple[int, ...]) -> int:
        return 8

    def consecutive(
        self, state: Any, block: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> list[Array]:
        """Return consecutive samples, in groups that share all but the last digit of their numbers."""
        bits, last = count.bit_length() - 1, 2 - self.log_spp % 2
        if count != 2**bits or bits > self.log_spp or self.rounds > 1:
            return super().consecutive(state, block, count, dims, dtype)
        numbers = [Number(block, low, bits) for low in range(count)]
        # Joint sequences would take longer to compile.
        few = isinstance(state, dict) and max(self.constituents) <= 2
        if self.orders is None or bits < last or not few or self._has_64_bits:
            return [self.numbered(state, number, dims, dtype, self.log_spp) for number in numbers]
        made = []
        for first in numbers[:: 2**last]:
            groups: dict[int, tuple[Array, list[Array]]] = {}
            for c in self._wanted(dims):
                position, node = state[c]
                place, changes = scrambled_group(self.orders.member(c), first, self.log_spp, node)
                groups[c] = append(position, place, self.log_spp)[1], changes
            each = [
                self._sequence(c).nearby_coordinates(*groups[c], j, dtype)
                for c, j in (self._places[j] for j in dims)
            ]
            made += [jnp.stack(point, axis=-1) for point in zip(*each, strict=True)]
        return made

    def numbered(
        self, state: Any, number: Number, dims: tuple[int, ...], dtype: DTypeLike, log_count: int | Array
    ) -> Array:
        """Return points of blocks of ``2**log_count``, by numbers with some static bits."""
        if len(self.constituents) == 1 and not self._has_64_bits:
            own = state if self.orders is None else state[0]
            return self._sequence(0).coordinates(self._index(0, own, number, log_count)[1], dims, dtype)
        places = [self._places[j] for j in dims]
        size = max(j for _, j in places) + 1

        def of_one(c: int | Array, own: Any) -> list[Array]:
            index = self._index(c, own, number, log_count)
            return [self._coordinate(c, index, j, dtype) for j in range(size)]

        wanted = self._wanted(dims)
        if self.orders is None or isinstance(state, dict):
            made = {c: of_one(c, state if self.orders is None else state[c]) for c in wanted}
        else:
            rows = jax.lax.map(lambda one: of_one(*one), (np.array(wanted, np.uint32), state))
            made = dict(zip(wanted, zip(*rows, strict=True), strict=True))
        return jnp.stack([made[c][j] for c, j in places], axis=-1)

    def _sequence(self, constituent: int | Array) -> BinarySequence:
        return self.sequence if self.frames is None else self.frames.moved(self.sequence, constituent)

    def _index(self, constituent: int | Array, own: Any, number: Number, log_count: int | Array) -> Index:
        passed = np.uint32(0)
        if self.rounds > 1:
            passed = number.word >> log_count
            number = Number(number.word ^ (passed << log_count))
        if self.orders is not None:
            order = self.orders.member(constituent)
            position, node = own
            if isinstance(log_count, int):
                place = scrambled_number(order, number, log_count, node)
            else:
                place = scrambled_numbers(order, number, log_count, self.log_spp, node)
        else:
            position, place = own, number.word
        return append(position ^ passed, place, log_count)

    @property
    def _has_64_bits(self) -> bool:
        return needed(4**self.log_side * self.spp, self.sequence)

    def _coordinate(self, constituent: int | Array, index: Index, dim: int, dtype: DTypeLike) -> Array:
        high, low = index
        sequence = self._sequence(constituent)
        sequence = sequence.with_high_word(high) if self._has_64_bits else sequence
        return sequence.coordinate(low, dim, dtype)


@frozen_pytree
class AdaptiveZ(Sampler):
    """The Z-sampler with a separate number of samples for each pixel."""

    loops = True

    sampler: Z
    log_counts: Array
    """uint32 (height, width): binary logarithms of the numbers."""

    @property
    def dims(self) -> int:
        return self.sampler.dims

    @property
    def fits(self) -> Fits:
        return self.sampler.fits

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return self.sampler.prepare(x, y, dims), self.log_counts[y, x]

    def with_tables(self, dims: tuple[int, ...]) -> "AdaptiveZ":
        return replace(self, sampler=self.sampler.with_tables(dims))

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        of_sampler, log_count = state
        return self.sampler.numbered(of_sampler, Number(sample), dims, dtype, log_count)

    def finer(self, count: int) -> "AdaptiveZ":
        return AdaptiveZ(self.sampler.finer(count), self.log_counts + np.uint32(count.bit_length() - 1))

    @property
    def _counts(self) -> Array:
        return np.uint32(self.sampler.rounds) << self.log_counts

    def __call__(self, x: Any, y: Any, sample: Any, *args: Any, **kwargs: Any) -> Array:
        """Return the points of the given pixels and samples, as all samplers, below the pixels' numbers."""
        points = super().__call__(x, y, sample, *args, **kwargs)
        x, y, sample = jnp.broadcast_arrays(x, y, sample)
        beyond = sample >= self._counts[y, x]
        if not isinstance(beyond, Tracer) and beyond.any():
            raise ValueError(
                f"sample must be below the {int(self._counts[y, x][beyond][0])} samples of its pixel, "
                f"got {int(sample[beyond][0])}"
            )
        return points

    def check(self, width: int, height: int, spp: int) -> None:
        least = int(self._counts.min())
        self.fits._replace(spp=least, why="samples of the pixel that has fewest").check(width, height, spp)
