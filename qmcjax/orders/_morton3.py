"""Morton order of pixels and frames, plain or scrambled."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.core.bits import hash_word
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders._frames import FrameOrder, animation_size
from qmcjax.orders._hashed import GOLDEN
from qmcjax.orders._hierarchy import permutation_number, permuted, unpermuted

_IDENTITY = 0
"""The number of the permutation that changes nothing."""


@frozen_pytree
class Morton3(FrameOrder):
    """Quadrant and half of the frames in turn, from the largest to the smallest; each node permutes its own.

    The word of a node is a hash of its parent's word and its digit. Digits are those of pixels and frames,
    before their permutation.
    """

    seed: Array | None
    """uint32 scalar; None without permutations."""

    @property
    def _levels(self) -> list[tuple[str, int]]:
        """Kind and place of each digit, the first one first."""
        count = max(self.log_side, self.log_frames)
        places = range(count - 1, -1, -1)
        both = [(kind, place) for place in places for kind in ("quadrant", "half")]
        return [(k, place) for k, place in both if place < (self.log_side, self.log_frames)[k == "half"]]

    def _node(self, shape: tuple[int, ...]) -> Array | None:
        return None if self.seed is None else jnp.broadcast_to(self.seed, shape)

    def unchecked_position(self, x: Array, y: Array, t: Array) -> Array:
        node, position, one = self._node(x.shape), jnp.zeros_like(x), np.uint32(1)
        for kind, place in self._levels:
            if kind == "half":
                digit = (t >> place) & one
                position = (position << 1) | _halved(node, digit)
            else:
                digit = ((x >> place) & one) | (((y >> place) & one) << 1)
                position = (position << 2) | permuted(_number(node), digit)
            node = _child(node, digit)
        return position

    def unchecked_pixel(self, position: Array) -> tuple[Array, Array, Array]:
        node, one, left = self._node(position.shape), np.uint32(1), 2 * self.log_side + self.log_frames
        x = y = t = jnp.zeros_like(position)
        for kind, place in self._levels:
            if kind == "half":
                left -= 1
                digit = _halved(node, (position >> left) & one)
                t = t | (digit << place)
            else:
                left -= 2
                digit = unpermuted(_number(node), (position >> left) & np.uint32(3))
                x, y = x | ((digit & one) << place), y | ((digit >> 1) << place)
            node = _child(node, digit)
        return x, y, t


def _number(node: Array | None) -> Array:
    return jnp.uint32(_IDENTITY) if node is None else permutation_number(node)


def _halved(node: Array | None, digit: Array) -> Array:
    """Exchange both halves, or not: its own inverse."""
    return digit if node is None else digit ^ (node >> 31)


def _child(node: Array | None, digit: Array) -> Array | None:
    # Plus one: the hash maps 0 to 0.
    return None if node is None else hash_word(node + (digit + np.uint32(1)) * GOLDEN)


def morton3(width: int, height: int, frames: int, key: Array | int | None = None) -> Morton3:
    """Make the Morton order of the pixels of an animation, or scramble it.

    Digits of the position are a quadrant and a half of the frames in turn, from the largest to the smallest:
    every aligned block of ``2**k`` x ``2**k`` pixels in ``2**k`` frames has a contiguous aligned run of
    positions, and so have its pixels in ``2**(k + 1)`` frames.

    Parameters
    ----------
    width, height : int, in [1, 65536]; padded to a square with a power of two as side
    frames : int
        Padded to a power of two; there are at most 2**32 positions. If the number of frames exceeds the side,
        the first digits are halves only; if the side is larger, they are quadrants only.
    key : jax.random.key, or int in [0, 2**32), optional
        Permutes the quadrants and halves of each block at random, as :func:`scrambled_morton` does; all
        permutations are equally likely. A new key does not recompile. None for plain Morton order.

    Returns
    -------
    Morton3
        ``position(x, y, t)``, ``pixel(position)``, and ``at_frame(t)``, an order of pixels for samplers.

    Notes
    -----
    With ``contiguous(order, sequence, spp)`` only these blocks are nets, not those with any number of pixels
    and frames, and errors of a single frame are larger than in an order of pixels alone:
    :func:`qmcjax.sequences.in_time` stratifies all blocks, and leaves each frame as it is.

    Examples
    --------
    >>> order = morton3(4, 4, 2)
    >>> print(order.position(1, 0, 1), [int(v) for v in order.pixel(3)])
    3 [1, 0, 1]
    """
    size = animation_size(width, height, frames)
    seed = None if key is None else draws.bits(checks.prng_key("key", key), (), jnp.uint32)
    return Morton3(*size, seed)
