"""Freshly randomised passes."""

from collections.abc import Callable
from dataclasses import field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.jax_internals import alike
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import OfDims
from qmcjax.samplers._plug_in import as_sampler


@frozen_pytree
class Randomized(OfDims):
    """Sample s is sample ``s % spp`` of a sampler made with a separate key for pass ``s // spp``."""

    sampler_of_key: Callable[[Array], Any] = field(metadata={"static": True})
    key: Array
    spp: int = field(metadata={"static": True})
    """Samples of a pixel in a pass."""

    def of_pass(self, number: Array | int) -> Any:
        """Return the sampler of a pass.

        Parameters
        ----------
        number : uint32 Array, shape (), or int, number of the pass, from 0

        Returns
        -------
        Sampler
        """
        return self.sampler_of_key(jax.random.fold_in(self.key, number))

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the points of the samples in their passes."""
        x, y = state
        number, inside = sample // np.uint32(self.spp), sample % np.uint32(self.spp)
        first = number.min()

        # One pass after the other, from the first to the last: images need only one.
        def fill(k: Array, values: Array) -> Array:
            of_pass = as_sampler("sampler_of_key", self.of_pass(first + k))(x, y, inside, dims, dtype)
            return jnp.where((number == first + k)[..., None], of_pass, values)

        with checks.precision(dtype):
            empty, *_ = alike((jnp.zeros((*x.shape, len(dims)), dtype), self, x, y, number))
            return jax.lax.fori_loop(np.uint32(0), number.max() - first + np.uint32(1), fill, empty)

    def check(self, width: int, height: int, spp: int) -> None:
        super().check(width, height, spp)
        as_sampler("sampler_of_key", self.of_pass(0)).check(width, height, self.spp)


def randomized(
    sampler_of_key: Callable[[Array], Any], key: Array | int, spp: int | None = None
) -> Randomized:
    """Sample in passes, each with a freshly randomised sampler.

    Passes are independent and have the same distribution. If each point of a pass is uniformly distributed,
    the mean over all samples is unbiased, and so is the estimate of its variance from several passes, see
    :func:`qmcjax.render_passes`. The price is uniformity across passes: the error of p passes decreases as
    p**-0.5. Each sample is as uniform over keys as that of one pass.

    Parameters
    ----------
    sampler_of_key : callable
        From a ``jax.random.key`` to a sampler, e.g. ``lambda key: contiguous(order, owen(sequence, key),
        spp)``. The same function object compiles once. It is traced with the samples: arrays that it refers
        to become constants.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile
    spp : int, optional
        Samples of a pixel in a pass, by default the ``spp`` of the sampler. For a sequence over the whole
        screen this is the largest number that its indices allow: give a smaller one.

    Returns
    -------
    Randomized
        A sampler: s is sample ``s % spp`` of pass ``s // spp``. ``of_pass(k)`` is the sampler of one pass,
        faster than calls with samples of many passes.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 4.2.

    Examples
    --------
    >>> from qmcjax import orders, samplers, sequences
    >>> def sampler_of_key(key):
    ...     scrambled = sequences.owen(sequences.sobol(2), key)
    ...     return samplers.contiguous(orders.hilbert(4, 4), scrambled, spp=4)
    >>> sampler = randomized(sampler_of_key, key=1)
    >>> print(sampler(0, 0, 9) == sampler.of_pass(2)(0, 0, 1))
    [ True  True]
    """
    key = checks.prng_key("key", key)
    if hasattr(sampler_of_key, "dims") or hasattr(sampler_of_key, "needs"):
        raise TypeError(
            "sampler_of_key must be a function that makes a sampler of a key, "
            f"got {checks.shown(sampler_of_key)}"
        )
    checks.function("sampler_of_key", sampler_of_key, "of a key")
    made = sampler_of_key(key)
    sampler = as_sampler("sampler_of_key(key)", made)
    if spp is None:
        spp = getattr(made, "spp", None)
        if spp is None:
            raise ValueError(f"spp must be given, since {type(made).__name__} has none, got None")
    return Randomized(sampler.dims, sampler_of_key, key, checks.integer("spp", spp, 1, 2**32 - 1))
