"""Unbounded sequences of multiples modulo 1: the lattice sequence and Kronecker sequences."""

import abc
from dataclasses import replace
from fractions import Fraction as Rational
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, tables
from qmcjax.core.bits import high_product, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.binary import BinarySequence, Dims, Fraction

LATTICE_DIMS = 250
"""Number of components of the vector of Cools, Kuo and Nuyens."""


class Multiples(BinarySequence):
    """Multiples of a vector modulo 1, as wrapping products of 32-bit fractions."""

    vector: Array
    """uint32 (dims,)."""

    @property
    def dims(self) -> int:
        return self.vector.shape[0]

    @abc.abstractmethod
    def _factor(self, index: Array) -> Array:
        """Return the factors of the vector."""

    def word(self, index: Array, dim: int) -> Array:
        return self._factor(index) * self.vector[dim]

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        if isinstance(dims, int):
            return super().fraction(index, dims)
        wanted = self.vector[np.array(dims)].reshape((1,) * index.ndim + (-1,))
        return Fraction(lambda: self._factor(index)[..., None] * wanted)


@frozen_pytree
class LatticeSequence(Multiples):
    """Point i is phi_2(i) z modulo 1."""

    vector: Array
    """uint32 (dims,): the generating vector z."""
    high: Array | None = None
    """Upper words of 64-bit indices."""

    called = "lattice"

    @property
    def limit_64(self) -> int:
        return checks.INDEX_LIMIT**2

    def with_high_word(self, high: Array) -> "LatticeSequence":
        return replace(self, high=high)

    def _factor(self, index: Array) -> Array:
        return reverse(index)

    def word(self, index: Array, dim: int) -> Array:
        if self.high is None:
            return super().word(index, dim)
        # The product of phi_2's 64 digits with z modulo 1: the upper 32 bits.
        z = jnp.broadcast_to(self.vector[dim], index.shape)
        return reverse(index) * z + high_product(reverse(self.high), z)

    def fraction(self, index: Array, dims: Dims) -> Fraction:
        few = self.high is None
        return super().fraction(index, dims) if few else BinarySequence.fraction(self, index, dims)


def lattice(dims: int) -> LatticeSequence:
    """Make the extensible rank-1 lattice sequence of Cools, Kuo and Nuyens.

    The first ``2**m`` points are the lattice of all multiples of ``z / 2**m``, numbered by radical
    inverses [2]_; later blocks of ``2**m`` points are shifted copies of it.

    Parameters
    ----------
    dims : int, in [1, 250]

    Returns
    -------
    LatticeSequence
        Exact in all 32 bits for every index. The vector was constructed for up to 2**20 points: larger
        lattices are as regular, but their quality is unknown.

    References
    ----------
    .. [1] R. Cools, F. Y. Kuo, D. Nuyens, "Constructing embedded lattice rules for multivariate
       integration", SIAM J. Sci. Comput. 28(6), 2006.
    .. [2] F. J. Hickernell, H. S. Hong, P. L'Ecuyer, C. Lemieux, "Extensible lattice sequences for
       quasi-Monte Carlo quadrature", SIAM J. Sci. Comput. 22, 2001.

    Examples
    --------
    >>> print(lattice(3).points(4))
    [[0.   0.   0.  ]
     [0.5  0.5  0.5 ]
     [0.25 0.75 0.75]
     [0.75 0.25 0.25]]
    """
    dims = checks.integer("dims", dims, 1, LATTICE_DIMS)
    vector = np.array(tables.rows("sequences", "ckn_lattice_vector.txt")).astype(np.uint32).ravel()
    return LatticeSequence(jnp.asarray(vector[:dims]))


ROBERTS_DIMS = 64

_DIGITS = 96
"""Digits of a step: 64 for the index, and 32 for the coordinate."""


@frozen_pytree
class Kronecker(BinarySequence):
    """Point i is i times a vector modulo 1, rounded down to 32 digits."""

    steps: Array
    """uint32 (dims, 3): the digits of the vector, 1 to 32 in word 0."""
    high: Array | None = None
    """Upper words of 64-bit indices."""

    called = "kronecker"

    @property
    def dims(self) -> int:
        return self.steps.shape[0]

    @property
    def limit_64(self) -> int:
        return checks.INDEX_LIMIT**2

    def with_high_word(self, high: Array) -> "Kronecker":
        return replace(self, high=high)

    def word(self, index: Array, dim: int) -> Array:
        return _multiple(self.steps[dim], index, np.uint32(0) if self.high is None else self.high)


def _multiple(step: Array, low: Array, high: Array | np.uint32) -> Array:
    """Return the upper word of ``(high * 2**32 + low) * step`` modulo 2**96.

    This is long multiplication: the product of two words plus a third word fits 64 bits.
    """
    with jax.enable_x64(True):
        first, second, third = (step[k].astype(jnp.uint64) for k in range(3))
        low, high = low.astype(jnp.uint64), high.astype(jnp.uint64)
        shift, mask = np.uint64(32), np.uint64(2**32 - 1)
        middle = low * second + (low * third >> shift)
        carried = (high * third + (middle & mask) >> shift) + (middle >> shift)
        return (low * first + high * second + carried).astype(jnp.uint32)


def kronecker(steps: Any) -> Kronecker:
    """Make a Kronecker sequence: point i is i times a vector, modulo 1.

    Parameters
    ----------
    steps : iterable of numbers, one for each dimension
        Finite floats, or exact numbers such as ``fractions.Fraction``, but not integers. Only the value
        modulo 1 matters; a float stands for its exact rational value.

    Returns
    -------
    Kronecker
        Each step is rounded to the nearest multiple of 2**-96. Its multiples are exact, then rounded down to
        32 digits: precision does not depend on the index, of 32 or of 64 bits. Coordinate j of point i
        differs from that of the given vector by less than 2**-32.

    Notes
    -----
    A float64 step has at most 53 digits after the radix point if it is in [0.5, 1): its multiples repeat
    after 2**53 points, and differ from those of the intended irrational number by up to i * 2**-54.

    References
    ----------
    .. [1] L. Kuipers, H. Niederreiter, "Uniform Distribution of Sequences", 1974, Sect. 1.6 and 2.3.

    Examples
    --------
    >>> print(kronecker([0.25, 0.625]).points(4))
    [[0.    0.   ]
     [0.25  0.625]
     [0.5   0.25 ]
     [0.75  0.875]]
    """
    wanted = "numbers, one for each dimension"
    try:
        given = list(np.asarray(steps) if isinstance(steps, Array) else steps)
    except TypeError:
        raise TypeError(f"steps must be {wanted}, got {checks.shown(steps)}") from None
    if not given:
        raise ValueError(f"steps must be {wanted}, got none")
    return _of_integers([_rounded(step, wanted) for step in given])


def roberts(dims: int = 2) -> Kronecker:
    """Make the Roberts sequence R_d, the Kronecker sequence of a generalised golden ratio.

    The steps are the powers p**-1, ..., p**-d of the root p > 1 of p**(d + 1) = p + 1: the golden ratio for
    d = 1, the plastic number for d = 2 (R2).

    Parameters
    ----------
    dims : int, d in [1, 64]

    Returns
    -------
    Kronecker
        Point 0 is the origin. In [1]_ it is (0.5, ..., 0.5): use :func:`rotate`.

    Notes
    -----
    The polynomial is irreducible [2]_, so 1 and the steps are a basis of a number field: no multiple k of the
    steps is closer to an integer vector than a constant times k**(-1 / d) [3]_, the best possible order. p is
    a Pisot number only for d = 1 and 2. The discrepancy in [1]_ is measured, not proven.

    References
    ----------
    .. [1] M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
    .. [2] E. S. Selmer, "On the irreducibility of certain trinomials", 1956.
    .. [3] J. W. S. Cassels, "Simultaneous Diophantine approximation II", 1955.

    Examples
    --------
    >>> print(roberts().points(3))
    [[0.         0.        ]
     [0.7548776  0.56984025]
     [0.5097553  0.13968056]]
    """
    dims = checks.integer("dims", dims, 1, ROBERTS_DIMS)
    # p < 2 by bisection, with 64 extra digits: powers up to 64 lose less than 8 of them.
    digits = _DIGITS + 64
    unit = 1 << digits
    low, high = unit, 2 * unit
    while high - low > 1:
        middle = (low + high) // 2
        power = middle
        for _ in range(dims):
            power = power * middle >> digits
        low, high = (middle, high) if power <= middle + unit else (low, middle)
    return _of_integers([_rounded(Rational(unit, low) ** j, "") for j in range(1, dims + 1)])


def _rounded(step: Any, wanted: str) -> int:
    """Return a number modulo 1 in units of 2**-96."""
    try:
        if isinstance(step, bool | np.bool_):
            raise TypeError
        exact = Rational(*step.as_integer_ratio())
    except (AttributeError, TypeError):
        raise TypeError(f"steps must be {wanted}, got {checks.shown(step)} among them") from None
    except (OverflowError, ValueError):
        raise ValueError(f"steps must be finite, got {checks.shown(step)} among them") from None
    units = round(exact * 2**_DIGITS) % 2**_DIGITS
    if not units:
        raise ValueError(f"steps must not be integers, got {checks.shown(step)} among them")
    return units


def _of_integers(steps: list[int]) -> Kronecker:
    words = [[step >> shift & 0xFFFFFFFF for shift in (64, 32, 0)] for step in steps]
    return Kronecker(jnp.asarray(np.array(words, np.uint32)))
