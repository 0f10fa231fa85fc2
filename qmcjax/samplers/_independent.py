"""One sequence in every pixel, randomised anew in each."""

from collections.abc import Callable
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax import checks
from qmcjax.bits import hash_word, owen_hash, reverse, to_unit
from qmcjax.pytrees import pytree
from qmcjax.samplers._base import Sampler, check_count
from qmcjax.sequences import BinarySequence


def _xor(mirror: Array, seed: Array) -> Array:
    return mirror ^ seed


_RANDOMIZERS: dict[str, Callable[[Array, Array], Array]] = {"owen": owen_hash, "xor": _xor}


@pytree
@dataclass(frozen=True)
class Independent(Sampler):
    """The points of a sequence, scrambled with a seed from pixel and coordinate."""

    sequence: BinarySequence
    seeds: Array
    """uint32 (dims, 2)."""

    randomizer: Callable[[Array, Array], Array] = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        return self.sequence.dims

    def _values(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        return jnp.stack([self._coordinate(x, y, sample, j, dtype) for j in dims], axis=-1)

    def _coordinate(self, x: Array, y: Array, sample: Array, dim: int, dtype: DTypeLike) -> Array:
        mirror = self.sequence.mirror(sample, dim)
        seed = hash_word(hash_word(x ^ self.seeds[dim, 0]) + y ^ self.seeds[dim, 1])
        return to_unit(reverse(self.randomizer(mirror, seed)), dtype)

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise a ValueError if the sequence has fewer points than samples are wanted."""
        check_count(spp, self.sequence.limit, "for this sequence")


def independent(sequence: BinarySequence, key: Array | int, randomize: str = "owen") -> Independent:
    """Sample every pixel with the first points of a sequence, randomised independently per pixel.

    Parameters
    ----------
    sequence : BinarySequence
        Any sequence that has ``bits``.
    key : jax.random.key, or int in [0, 2**32)
    randomize : {"owen", "xor"}
        Owen scrambling by hashing, or xor with a random word (a digital shift).

    Returns
    -------
    Independent

    Raises
    ------
    ValueError
        If ``sequence`` is not in base 2, ``key`` is no key or ``randomize`` no randomisation.

    References
    ----------
    .. [1] A. G. M. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error
       via Hierarchical Ordering of Pixels", 2020, Sect. 4 (the (0,2)-sequence sampler it compares with).

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.independent(sequences.sobol(2), key=0)
    >>> print(sampler(0, 0, 1).shape, bool((sampler(0, 0, 1) == sampler(1, 0, 1)).any()))
    (2,) False
    """
    if not isinstance(sequence, BinarySequence):
        raise ValueError(f"sequence must be in base 2 (one that has .bits), got {sequence!r}")
    if randomize not in _RANDOMIZERS:
        raise ValueError(f"randomize must be one of {sorted(_RANDOMIZERS)}, got {randomize!r}")
    seeds = jax.random.bits(checks.prng_key("key", key), (sequence.dims, 2), jnp.uint32)
    return Independent(sequence, seeds, _RANDOMIZERS[randomize])
