"""Nets with (0,m,2)-nets in all consecutive pairs of dimensions, by cascaded Sobol' components."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.sequences._digital.digital import Digital
from qmcjax.sequences._digital.joe_kuo import matrices_of
from qmcjax.sequences._protocol.binary import BinarySequence

# fmt: off
_CHOSEN = (
    1, 1, 2, 2, 2, 2, 4, 3, 18, 2, 2, 2, 2, 23, 9, 8, 3, 1, 39, 8, 29, 1, 3, 23, 31, 35, 13, 60, 36, 35, 24,
)
# fmt: on
"""The component of Joe and Kuo's table, from 1, that maps each dimension to the next."""

CASCADED_DIMS = 1 + len(_CHOSEN)


@frozen_pytree
class DigitalNet(Digital):
    """The first 2**m points of matrices of order m, which do not extend to a sequence."""

    m: int = field(default=32, metadata={"static": True})

    called = "cascaded_net"
    reported = ("dims", "m")

    @property
    def size(self) -> int:
        return 2**self.m

    def inverted(self, log_side: int) -> Any:
        """Raise: there are no frames."""
        return BinarySequence.inverted(self, log_side)


def cascaded_net(m: int, dims: int) -> DigitalNet:
    """Make a net of 2**m points with (0,m,2)-nets in all consecutive pairs of dimensions.

    The first coordinate is i / 2**m. Each further coordinate is a component of the Sobol' sequence, with 2**m
    times the previous coordinate as index.

    Parameters
    ----------
    m : int, in [1, 32]
    dims : int, in [1, 32]; fewer dimensions are the first of these

    Returns
    -------
    DigitalNet
        The net for m is not part of the net for m + 1.

    Notes
    -----
    The construction is that of [1]_; the components are from our own search
    (``analysis/tables/make_cascade.py``) among Joe and Kuo's, one after the other, for small t of all pairs,
    and of three and four consecutive dimensions, for m = 4 to 14. The choice matters: with Pascal's matrix P,
    that of x + 1, for all dimensions, every third dimension is the same, since (P J)**3 is the identity,
    where J reverses the digits. Over all pairs of the 32 dimensions, the mean of t is 2.1, 2.7 and 3.3 for m
    = 8, 12 and 15, the largest t 6, 8 and 11; for :func:`sobol` the mean is 2.2, 2.5 and 2.9, the largest 5,
    5 and 6.

    References
    ----------
    .. [1] L. Paulin, D. Coeurjolly, J.-C. Iehl, N. Bonneel, A. Keller, V. Ostromoukhov, "Cascaded Sobol'
       Sampling", ACM Trans. Graph. 40(6), 2021.

    Examples
    --------
    >>> print((cascaded_net(2, 4).points(4) * 4).astype(int))
    [[0 0 0 0]
     [1 2 3 1]
     [2 3 1 2]
     [3 1 2 3]]
    """
    m = checks.integer("m", m, 1, 32)
    dims = checks.integer("dims", dims, 1, CASCADED_DIMS)
    matrices = matrices_of(max(_CHOSEN) + 1)
    columns = np.zeros((dims, 32), np.uint32)
    columns[0, :m] = np.uint32(1) << np.arange(32 - m, 32, dtype=np.uint32)
    for dim, component in enumerate(_CHOSEN[: dims - 1], start=1):
        index = columns[dim - 1, :m] >> np.uint32(32 - m)
        digits = index[:, None] >> np.arange(m, dtype=np.uint32) & np.uint32(1)
        columns[dim, :m] = np.bitwise_xor.reduce(digits * matrices[component - 1, :m], axis=1)
    return DigitalNet(jnp.asarray(columns), m=m)
