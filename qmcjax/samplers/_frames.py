"""The frame of an animation, with an order of the frames for each pair of coordinates, or all together."""

import jax
import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import owen_hash, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences import BinarySequence, InTime, in_time

_STREAM = 0x66726D65
"""Number of the stream of random words for frames, apart from all others of a key."""


@frozen_pytree
class Frames:
    """A frame and its places in several orders: the first one is plain, the others are scrambled.

    Aligned blocks of frames stay such blocks.
    """

    seeds: Array
    """uint32 (orders - 1,)."""
    numbers: Array
    """uint32 (orders,)."""

    def moved(self, sequence: BinarySequence, number: int) -> InTime:
        """Return a sequence at the place of the frame in one of the orders."""
        return in_time(sequence).at_frame(self.numbers[number])


def at_frame(frames: Frames | None, frame: Array | int) -> Frames:
    """Return another frame, or raise a TypeError if there are none."""
    if frames is None:
        raise TypeError("sampler must be made with frames=... for at_frame, got one made with frames=None")
    number = checks.frame(frame)
    # A bit is flipped by a hash of the bits above it, which are the first digits of a reversed fraction.
    others = reverse(owen_hash(reverse(jnp.broadcast_to(number, frames.seeds.shape)), frames.seeds))
    return Frames(frames.seeds, jnp.concatenate([number[None], others]))


def of_key(frames: int, sequence: BinarySequence, key: Array | int | None, count: int) -> Frames:
    """Return frame 0 with ``count`` orders, for a sequence that is to move; without a key seeds are zeros.

    Nothing depends on the number of frames.
    """
    checks.integer("frames", frames, 1, checks.INDEX_LIMIT)
    in_time(sequence)
    seeds = jnp.zeros((count - 1,), jnp.uint32)
    if key is not None:
        random = jax.random.fold_in(checks.prng_key("key", key), _STREAM)
        seeds = draws.bits(random, seeds.shape, jnp.uint32)
    return at_frame(Frames(seeds, jnp.zeros((count,), jnp.uint32)), 0)
