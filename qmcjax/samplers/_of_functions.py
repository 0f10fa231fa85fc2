"""User-defined samplers: objects with a sampler's methods, functions of pixel and sample, or of a key."""

from collections.abc import Callable
from dataclasses import field, replace
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.bits import below_one
from qmcjax.core.jax_internals import alike
from qmcjax.core.plug_ins import parameters, unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import Sampler, more_samples
from qmcjax.samplers._kinds import OfDims

MAX_DIMS = 2**16

_PROTOCOL = "dims, and either a call on (x, y, sample, dims[, dtype]) or the methods prepare and points"


class _Calls(Protocol):
    @property
    def dims(self) -> int: ...

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], /) -> Any: ...


class _CallsInDtype(Protocol):
    @property
    def dims(self) -> int: ...

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: Any, /) -> Any: ...


class _Prepares(Protocol):
    @property
    def dims(self) -> int: ...

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...], /) -> Any: ...

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: Any, /) -> Any: ...


SamplerLike = Sampler | _Calls | _CallsInDtype | _Prepares
"""The type of what :func:`as_sampler` takes."""


@frozen_pytree
class PlugIn(Sampler):
    """An object that implements the protocol, without defaults."""

    wrapped: Any

    @property
    def sampler(self) -> Any:
        return unwrap(self.wrapped)

    @property
    def dims(self) -> int:
        return self.sampler.dims

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return self.sampler.prepare(x, y, dims) if _prepares(self.sampler) else (x, y)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        if _prepares(self.sampler):
            return self.sampler.points(state, sample, dims, dtype)
        if _positional(self.sampler) > 4:
            return self.sampler(*state, sample, dims, dtype)
        return rounded(self.sampler(*state, sample, dims), dtype)

    def check(self, width: int, height: int, spp: int) -> None:
        super().check(width, height, spp)
        if hasattr(self.sampler, "check"):
            self.sampler.check(width, height, spp)


@frozen_pytree
class Function(OfDims):
    """The points of a function of pixel and sample."""

    wrapped: Any

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        values = unwrap(self.wrapped)(*state, sample)
        wanted = (*sample.shape, self.dims)
        if jnp.shape(values) != wanted:
            raise ValueError(f"f must return points of shape {wanted}, got {checks.shown(values)}")
        values = rounded(values, dtype)
        return values if dims == tuple(range(self.dims)) else values[..., np.array(dims)]


def function(f: Callable[[Array, Array, Array], Array], dims: int) -> Function:
    """Make a sampler from a function.

    Parameters
    ----------
    f : callable
        From column, row and sample, uint32 Arrays of one shape (...), to points in [0, 1), floats of shape
        (..., dims). It is traced; the same function object compiles once.
    dims : int, number of coordinates, in [1, 65536]

    Returns
    -------
    Function
        Values are rounded to the requested dtype, but never up to 1.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from qmcjax import samplers
    >>> centres = samplers.function(lambda x, y, sample: jnp.full((*x.shape, 2), 0.5), dims=2)
    >>> print(centres(3, 1, 0))
    [0.5 0.5]
    """
    checks.function("f", f, "of x, y and sample", 3)
    return Function(checks.integer("dims", dims, 1, MAX_DIMS), wrap("f", f))


def as_sampler(name: str, value: Any) -> Sampler:
    """Return an object that implements the sampler protocol as a :class:`Sampler`.

    Parameters
    ----------
    name : str, name of the argument, for messages
    value : Sampler, or object
        An object with ``dims``, the number of coordinates, and either a call ``(x, y, sample, dims, dtype)``
        or ``(x, y, sample, dims)`` that returns points ``[..., len(dims)]``, or the methods ``prepare`` and
        ``points`` of :class:`Sampler`. A method ``check(width, height, spp)`` is optional.

    Returns
    -------
    Sampler
        ``value`` itself if it is one.
    """
    if isinstance(value, Sampler):
        return value
    dims = getattr(value, "dims", None)
    whole = isinstance(dims, int | np.integer) and not isinstance(dims, bool)
    if isinstance(value, type) or not whole or not (_prepares(value) or _positional(value) >= 4):
        hint = " (for one of x, y and sample, use samplers.function)" if callable(value) else ""
        raise TypeError(f"{name} must be a sampler ({_PROTOCOL}), got {checks.shown(value)}{hint}")
    return PlugIn(wrap(name, value))


def rounded(values: Any, dtype: DTypeLike) -> Array:
    """Round floats below 1 to a dtype, never up to 1."""
    if not jnp.issubdtype(getattr(values, "dtype", np.bool_), jnp.floating):
        raise ValueError(f"sampler must return floats, got {checks.shown(values)}")
    if values.dtype == dtype:
        return values
    with checks.precision(dtype):
        cast = values.astype(dtype)
        return jnp.where(values < 1, jnp.minimum(cast, below_one(dtype)), cast)


def _prepares(value: Any) -> bool:
    return callable(getattr(value, "prepare", None)) and callable(getattr(value, "points", None))


def _positional(value: Any) -> int:
    """Return the number of positional arguments of a call, 0 if there is no call."""
    known = parameters(value)
    if any(p.kind is p.VAR_POSITIONAL for p in known):
        return 5
    return sum(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) for p in known)


@frozen_pytree
class Randomized(OfDims):
    """Sample s is sample ``s % spp`` of a sampler made with a separate key for pass ``s // spp``."""

    sampler_of_key: Callable[[Array], Any] = field(metadata={"static": True})
    key: Array
    spp: int = field(metadata={"static": True})
    """Samples of a pixel in a pass."""
    sub_samples: int = field(default=1, metadata={"static": True})
    """How many of a sample each pass has, by ``finer``."""

    def of_pass(self, number: Array | int) -> Any:
        """Return the sampler of a pass.

        Parameters
        ----------
        number : uint32 Array, shape (), or int, number of the pass, from 0

        Returns
        -------
        Sampler
        """
        made = self.sampler_of_key(jax.random.fold_in(self.key, number))
        return made if self.sub_samples == 1 else as_sampler("sampler_of_key", made).finer(self.sub_samples)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        x, y = state
        number, inside = sample // np.uint32(self.spp), sample % np.uint32(self.spp)
        first = number.min()

        # One pass after another, from the first to the last: an image needs only one.
        def fill(k: Array, values: Array) -> Array:
            of_pass = as_sampler("sampler_of_key", self.of_pass(first + k))(x, y, inside, dims, dtype)
            return jnp.where((number == first + k)[..., None], of_pass, values)

        with checks.precision(dtype):
            empty, *_ = alike((jnp.zeros((*x.shape, len(dims)), dtype), self, x, y, number))
            return jax.lax.fori_loop(np.uint32(0), number.max() - first + np.uint32(1), fill, empty)

    def finer(self, count: int) -> "Randomized":
        spp = more_samples(self.spp, count, checks.INDEX_LIMIT - 1)
        return replace(self, spp=spp, sub_samples=self.sub_samples * count)

    def check(self, width: int, height: int, spp: int) -> None:
        super().check(width, height, spp)
        as_sampler("sampler_of_key", self.of_pass(0)).check(width, height, self.spp)


def randomized(
    sampler_of_key: Callable[[Array], SamplerLike], key: Array | int, spp: int | None = None
) -> Randomized:
    """Sample in passes, each with a freshly randomised sampler.

    Passes are independent and identically distributed. If each point of a pass is uniformly distributed, the
    mean over all samples is unbiased, and so is the estimate of its variance from several passes, see
    :func:`qmcjax.render_passes`. The drawback: points of different passes are not jointly uniform, so the
    error of p passes decreases as p**-0.5. Each sample is as uniform over keys as in a single pass.

    Parameters
    ----------
    sampler_of_key : callable
        From a ``jax.random.key`` to a sampler, e.g. ``lambda key: contiguous(order, owen(sequence, key),
        spp)``. The same function object compiles once. It is traced with the samples: arrays that it refers
        to become constants.
    key : jax.random.key, or int in [0, 2**32); a new key does not recompile
    spp : int, optional
        Samples per pixel in a pass, by default those that the sampler was made for.

    Returns
    -------
    Randomized
        Sample s is sample ``s % spp`` of pass ``s // spp``. ``of_pass(k)`` is the sampler of one pass, faster
        than calls with samples of many passes.

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
        spp = getattr(made, "spp", sampler.fits.spp if sampler.fits.exact else None)
        if spp is None:
            raise ValueError(f"spp must be given, since {type(made).__name__} has none, got None")
    return Randomized(sampler.dims, sampler_of_key, key, checks.integer("spp", spp, 1, 2**32 - 1))
