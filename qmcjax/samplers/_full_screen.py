"""One net over the whole screen: each pixel takes the points that fall into it."""

from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import log_side
from qmcjax.samplers._base import ForImage
from qmcjax.samplers._halton_full_screen import HaltonFullScreen, halton_full_screen
from qmcjax.sequences import Invertible, RadicalInverses, Sequence, inverted


@frozen_pytree
class FullScreen(ForImage):
    """A net scaled to the raster."""

    net: Invertible

    _sized = "net"
    _limited = "for this sequence and image"

    @property
    def dims(self) -> int:
        return self.net.dims

    @property
    def spp(self) -> int:
        """Number of points of the net in each pixel."""
        return self.net.points_per_cell(self.log_side)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        index = self.net.index_in_cell(x, y, self.log_side, sample)
        # The leading bits of the first two coordinates are the pixel: shifted out, the rest has full
        # precision at any resolution.
        words = [self.net.word(index, j) << (self.log_side if j < 2 else 0) for j in dims]
        return jnp.stack([to_unit(word, dtype) for word in words], axis=-1)

    def _check_count(self, spp: int, limit: int | None = None) -> None:
        if self.net.size is None:
            super()._check_count(spp, limit)
        elif spp != self.spp:
            raise ValueError(f"spp must be {self.spp}, the net's points in a pixel of this image, got {spp}")


def full_screen(net: Invertible | Sequence, width: int, height: int) -> FullScreen | HaltonFullScreen:
    """Sample the whole screen with one net, each pixel with the points that fall into it.

    The index of a point follows from its pixel by inverting the net on integers, without tables of pixels.

    Parameters
    ----------
    net : sequence in base 2, or Halton sequence
        An invertible one: a digital sequence, a net with ``index_in_cell``, or
        :func:`qmcjax.sequences.digital_shift` or ``art_owen`` of one of these. With ``2**k`` the smallest
        power of two that covers the image, a net of ``2**m`` points puts ``2**(m - 2 k)`` into every pixel,
        and a digital (0,2)-sequence one point in each frame of ``4**k`` points. A Halton sequence, with
        permuted digits or not, puts one of each ``2**a * 3**b`` points into every pixel of a raster of
        ``2**a`` by ``3**b`` pixels, the smallest that covers the image.
    width, height : int, in [1, 65536]; for a Halton sequence ``2**a * 3**b`` must be at most 2**32

    Returns
    -------
    FullScreen or HaltonFullScreen
        ``spp`` is the number of points in a pixel. A net can only be rendered with this number of samples.
        For a sequence it is the largest that 32-bit indices allow: for the Halton sequence 11506 for an image
        of 512 x 512 pixels, 958 for 1920 x 1080, and 26 for 8192 x 8192.

    Notes
    -----
    The pixel of a point is a function of its leading digits, which a digital shift flips: this is undone
    before inverting the net. For the Halton sequence, column and row give the index modulo 2**a and 3**b.

    Each sample of a pixel is uniform over keys after a digital shift and for randomly permuted digits; with
    ``jittered`` only all samples of a pixel together, since each has its own cell. Others have no key.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 and 5.2.5.
    .. [2] A. Keller, "Myths of computer graphics", Monte Carlo and Quasi-Monte Carlo Methods 2004, 2006 (the
       Halton sequence over the pixel raster).

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> sampler = samplers.full_screen(sequences.larcher_pillichshammer_net(20), 256, 256)
    >>> print(sampler.spp, sampler(255, 255, 15))
    16 [0.96875    0.33325195]
    >>> print(samplers.full_screen(sequences.halton(2), 2, 3)(1, 2, 0))  # point 5, (0.625, 0.777...), of 6
    [0.25       0.33333334]
    """
    width, height = checks.image_size(width, height)
    if isinstance(net, RadicalInverses):
        return halton_full_screen(net, width, height)
    return FullScreen(width, height, inverted(net, log_side(width, height)))
