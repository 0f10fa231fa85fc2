"""Radical inverses: the van der Corput and the Halton sequence."""

from dataclasses import dataclass, field

import jax
from jax import Array
from jax.typing import DTypeLike

from qmcjax import checks
from qmcjax.digits import radical_inverse
from qmcjax.sequences._base import Sequence
from qmcjax.sequences._digital import Digital, sobol

HALTON_DIMS = 1024
"""Every component is unrolled in the program: beyond this it takes too long to compile."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RadicalInverses(Sequence):
    """One radical inverse a coordinate (Hilbert paper, Eq. 1)."""

    bases: tuple[int, ...] = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of coordinates."""
        return len(self.bases)

    def coordinate(self, index: Array, dim: int, dtype: DTypeLike) -> Array:
        """Return one coordinate of valid indices, in their shape."""
        return radical_inverse(index, self.bases[dim], dtype)


def van_der_corput(base: int = 2) -> RadicalInverses | Digital:
    """Make the van der Corput sequence: the digits of the index, reflected at the radix point.

    Parameters
    ----------
    base : int
        In [2, 65536]. In base 2 the sequence has exact ``bits``.

    Returns
    -------
    Sequence
        One dimension.

    Raises
    ------
    ValueError
        If ``base`` is out of range.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Eq. 1.

    Examples
    --------
    >>> print(van_der_corput(3).points(4)[:, 0])
    [0.         0.33333334 0.6666667  0.11111111]
    """
    base = checks.integer("base", base, 2, 2**16)
    return sobol(1) if base == 2 else RadicalInverses((base,))


def halton(dims: int) -> RadicalInverses:
    """Make the Halton sequence: radical inverses in the first prime bases.

    Parameters
    ----------
    dims : int
        In [1, 1024].

    Returns
    -------
    RadicalInverses
        Every value is the exact fraction, rounded once.

    Raises
    ------
    ValueError
        If ``dims`` is out of range.

    References
    ----------
    .. [1] A. Keller, C. Waechter, N. Binder, "Rendering along the Hilbert Curve", 2022, Sect. 3.1.

    Examples
    --------
    >>> print(halton(2).points(3))
    [[0.         0.        ]
     [0.5        0.33333334]
     [0.25       0.6666667 ]]
    """
    return RadicalInverses(_primes(checks.integer("dims", dims, 1, HALTON_DIMS)))


def _primes(count: int) -> tuple[int, ...]:
    primes: list[int] = []
    candidate = 2
    while len(primes) < count:
        if all(candidate % p for p in primes):
            primes.append(candidate)
        candidate += 1
    return tuple(primes)
