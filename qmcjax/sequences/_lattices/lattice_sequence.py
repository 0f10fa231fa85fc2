"""The extensible rank-1 lattice sequence in base 2, by exact integer arithmetic modulo 1."""

import abc

import jax.numpy as jnp
import numpy as np
from jax import Array

from qmcjax.core import checks, tables
from qmcjax.core.bits import high_product, reverse
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._protocol.base import Derived
from qmcjax.sequences._protocol.binary import WordFirst
from qmcjax.sequences._protocol.fraction import Fraction

LATTICE_DIMS = 250
"""Number of components of Cools, Kuo and Nuyens' vector."""


class Multiples(WordFirst):
    """Multiples of a vector modulo 1: as fractions of 32 bits, products of words that wrap."""

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

    def fractions(self, index: Array, dims: tuple[int, ...]) -> Fraction:
        wanted = self.vector[np.array(dims)].reshape((1,) * index.ndim + (-1,))
        return Fraction(lambda: self._factor(index)[..., None] * wanted)


@frozen_pytree
class LatticeSequence(Multiples):
    """Point i is phi_2(i) z modulo 1."""

    vector: Array
    """uint32 (dims,): the generating vector z."""

    called = "lattice"

    @property
    def limit_64(self) -> int:
        return checks.INDEX_LIMIT**2

    def with_high_word(self, high: Array) -> "Lattice64":
        return Lattice64(self, high)

    def _factor(self, index: Array) -> Array:
        return reverse(index)


@frozen_pytree
class Lattice64(Derived, WordFirst):
    """Point i is point ``high * 2**32 + i`` of a lattice sequence, rounded down to 32 digits."""

    sequence: LatticeSequence
    high: Array

    def word(self, index: Array, dim: int) -> Array:
        # The product of phi_2's 64 digits with z modulo 1: the upper 32 bits.
        z = jnp.broadcast_to(self.sequence.vector[dim], index.shape)
        return reverse(index) * z + high_product(reverse(self.high), z)


def lattice(dims: int) -> LatticeSequence:
    """Make the extensible rank-1 lattice sequence of Cools, Kuo and Nuyens.

    The first ``2**m`` points are the lattice of all multiples of ``z / 2**m``, numbered by radical
    inverses [2]_; the later blocks of ``2**m`` points are shifted copies of it.

    Parameters
    ----------
    dims : int, in [1, 250]

    Returns
    -------
    LatticeSequence
        Exact in all 32 bits for every index. The vector was constructed for up to 2**20 points: beyond, the
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
