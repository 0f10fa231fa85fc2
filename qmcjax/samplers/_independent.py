"""One sequence in every pixel, randomised independently."""

from collections.abc import Callable
from dataclasses import field

import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_pair, owen_hash, reverse, to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import InEveryPixel
from qmcjax.sequences import BinarySequence, Sequence, as_sequence

Randomizer = Callable[[Sequence, Array, int, Array, DTypeLike], Array]


def _owen(sequence: BinarySequence, sample: Array, dim: int, seed: Array, dtype: DTypeLike) -> Array:
    return to_unit(reverse(owen_hash(sequence.bit_reversed(sample, dim), seed)), dtype)


def _xor(sequence: BinarySequence, sample: Array, dim: int, seed: Array, dtype: DTypeLike) -> Array:
    return to_unit(reverse(sequence.bit_reversed(sample, dim) ^ seed), dtype)


def _shift(sequence: Sequence, sample: Array, dim: int, seed: Array, dtype: DTypeLike) -> Array:
    return sequence.rotated_coordinate(sample, dim, seed, dtype)


_RANDOMIZERS: dict[str, Callable[..., Array]] = {"owen": _owen, "shift": _shift, "xor": _xor}


@frozen_pytree
class Independent(InEveryPixel):
    """The points of a sequence, randomised with a seed from pixel and coordinate."""

    sequence: Sequence
    seeds: Array
    """uint32 (dims, 2)."""
    randomizer: Randomizer = field(metadata={"static": True})

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> tuple[Array, ...]:
        """Return the seeds of pixels, one for each coordinate."""
        return tuple(hash_pair(x ^ self.seeds[j, 0], y ^ self.seeds[j, 1]) for j in dims)

    def points(
        self, state: tuple[Array, ...], sample: Array, dims: tuple[int, ...], dtype: DTypeLike
    ) -> Array:
        seeds = zip(dims, state, strict=True)
        values = [self.randomizer(self.sequence, sample, j, seed, dtype) for j, seed in seeds]
        return jnp.stack(values, axis=-1)


def independent(sequence: Sequence, key: Array | int, randomize: str = "owen") -> Independent:
    """Sample every pixel with the first points of a sequence, randomised independently per pixel.

    Parameters
    ----------
    sequence : Sequence, with ``bits``; any sequence for "shift"
    key : jax.random.key, or int in [0, 2**32)
    randomize : {"owen", "xor", "shift"}
        Owen scrambling by hashing, xor with a random word (a digital shift), or a random shift modulo 1 (a
        Cranley-Patterson rotation [2]_), for sequences that are uniform on the torus, like lattices. The sum
        is exact in base 2; for any other sequence it is rounded once from float64, never to 1.

    Notes
    -----
    Each sample of each pixel is uniform over keys, also the first one.

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
