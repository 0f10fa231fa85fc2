"""One scrambled sequence in every pixel, with keys that distribute errors as blue noise."""

from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks, draws, tables
from qmcjax.core.bits import to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import InEveryPixel
from qmcjax.sequences import BinarySequence, InTime, Owen, in_time, sobol


@frozen_pytree
class Ranked(InEveryPixel):
    """Sample s of a pixel is point s xor its ranking key, xor its scrambling keys, of one sequence."""

    sequence: BinarySequence

    ranks: Array
    """uint32 (rows, columns), powers of two: ranking keys."""
    scrambles: Array
    """uint32 (rows, columns, dims): scrambling keys, as 32-bit fractions."""
    translation: Array
    """uint32 (2,): offsets of x and y."""

    def at_frame(self, frame: Array | int) -> "Ranked":
        """Return the sampler of a frame of an animation, by :func:`qmcjax.sequences.in_time`.

        Over aligned blocks of frames and samples, each coordinate of a pixel is stratified. All frames are
        the same program.

        Parameters
        ----------
        frame : int, or integer Array of shape (), in [0, 2**32)
        """
        moving = self.sequence if isinstance(self.sequence, InTime) else in_time(self.sequence)
        return replace(self, sequence=moving.at_frame(frame))

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the rows and columns of pixels in the tile."""
        rows, columns = self.ranks.shape
        column = (x + self.translation[0]) & np.uint32(columns - 1)
        return (y + self.translation[1]) & np.uint32(rows - 1), column

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:

        def keys(table: Array) -> Array:
            return table.at[state].get(mode="promise_in_bounds")

        index = sample ^ keys(self.ranks)
        return jnp.stack(
            [to_unit(self.sequence.word(index, j) ^ keys(self.scrambles[:, :, j]), dtype) for j in dims],
            axis=-1,
        )


def ranked(dims: int, key: Array | int) -> Ranked:
    """Sample with scrambling and ranking keys that distribute errors as blue noise.

    All pixels have the same Owen-scrambled Sobol' sequence. The scrambling keys of a pixel, one per
    dimension, are added digitally to its points, its ranking key to the index. A tile of 64 x 64 pixels
    repeats.

    Parameters
    ----------
    dims : int, 2, 3 or 4: optimised for all these dimensions together
    key : jax.random.key, or int in [0, 2**32)
        Translates the tile at random. A new key does not recompile.

    Returns
    -------
    Ranked
        Optimised for 1, 2, 4, 8 and 16 samples. Other numbers work; errors are then less blue.
        ``sampler.at_frame(t)`` is the sampler of frame t of an animation.

    Notes
    -----
    Neither kind of key changes the stratification of a pixel's points: each aligned block of 2**k samples is
    a (t,k,dims)-net with the t of the Sobol' sequence, 0 in two dimensions.

    The keys of a tile are a fixed pool; only their arrangement was searched. The pool is such that the first
    samples of the pixels of a tile are the first 4096 points of the Sobol' sequence, in their leading 12
    digits, and that each further sample number has the 4096 points of 16 digitally shifted blocks of 256. So,
    over all translations, the expectation of each sample of each pixel is the mean of a function over such
    points, and means over a tile have small errors, whatever the number of samples. Each sample of a pixel,
    also the first one, is uniform over keys up to the cells of these points, not exactly.

    The arrangement was searched for small errors after a Gaussian low-pass filter of standard deviation 1.5
    pixels, in mean squares over 1024 random half-spaces as integrands and over prefixes of 1, 2, 4, 8 and 16
    samples, with weights 4, 2, 1, 1, 1. This is our own optimisation, of both kinds of keys at once, and not
    that of [1]_. The gain decreases with samples and dimensions: ``_data/README.md`` has measured spectra.

    References
    ----------
    .. [1] E. Heitz, L. Belcour, V. Ostromoukhov, D. Coeurjolly, J.-C. Iehl, "A Low-Discrepancy Sampler that
       Distributes Monte Carlo Errors as a Blue Noise in Screen Space", SIGGRAPH Talks, 2019.

    Examples
    --------
    >>> sampler = ranked(2, key=0)
    >>> print(sampler(3, 5, 7) == sampler(67, 5, 7))
    [ True  True]
    """
    dims = checks.integer("dims", dims, 2, 4)
    names = "seeds", f"ranks_{dims}", f"keys_{dims}"
    seeds, ranks, scrambles = tables.arrays("samplers", "ranked.npz", *names)
    return Ranked(
        Owen(sobol(dims), jnp.asarray(seeds[:dims])),
        jnp.asarray(ranks, jnp.uint32),
        jnp.asarray(scrambles, jnp.uint32) << 16,
        draws.bits(checks.prng_key("key", key), (2,), jnp.uint32),
    )
