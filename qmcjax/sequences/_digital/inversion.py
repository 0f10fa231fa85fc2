"""From cells of a raster to the points of nets and of digital sequences, scrambled or not."""

from typing import Any

from qmcjax.core import checks
from qmcjax.sequences._digital.cells import Invertible, NetByFrames
from qmcjax.sequences._digital.digital import Digital
from qmcjax.sequences._protocol.binary import BinarySequence


def inverted(net: Any, log_side: int) -> Invertible:
    """Return an object that finds the points of a net, or of a digital sequence, from their cells.

    Parameters
    ----------
    net : sequence in base 2
        A digital sequence, a net with ``index_in_cell``, or ``digital_shift`` or ``art_owen`` of one, with
        equally many points in each cell.
    log_side : int
        Binary logarithm of the number of cells per side, in [0, 16].

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.4 with "Scrambling", and 5.2.5.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from qmcjax import sequences
    >>> net = sequences.digital_shift(sequences.hammersley_net(6), key=1)
    >>> index = inverted(net, 3).index_in_cell(jnp.uint32(5), jnp.uint32(2), 3, jnp.uint32(0))
    >>> print((net(index) * 8).astype(int))
    [5 2]
    """
    log_side = checks.integer("log_side", log_side, 0, 16)
    if isinstance(net, BinarySequence):
        return net.inverted(log_side)
    if not isinstance(net, Invertible):
        raise TypeError(f"net must be invertible (have index_in_cell), got {checks.shown(net)}")
    net.points_per_cell(log_side)
    return net


def net_by_frames(sequence: Digital, log_side: int) -> NetByFrames:
    """Invert a digital (0,2)-sequence: find its points from their cells.

    Parameters
    ----------
    sequence : Digital
        At least two dimensions; the first two must be a (0,2)-sequence, or at least put one of each
        ``4**log_side`` points into every cell.
    log_side : int
        Binary logarithm of the number of cells per side, in [0, 16].

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 5.2.5, without its tables, for any ``log_side``.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from qmcjax import sequences
    >>> frames = net_by_frames(sequences.sobol(2), 3)
    >>> index = frames.index_in_cell(jnp.uint32(5), jnp.uint32(2), 3, jnp.uint32(0))
    >>> print(sequences.sobol(2)(index) * 8)
    [5.75 2.75]
    """
    if not isinstance(sequence, Digital):
        raise TypeError(f"sequence must be digital in base 2 (have matrices), got {checks.shown(sequence)}")
    return sequence.inverted(checks.integer("log_side", log_side, 0, 16))
