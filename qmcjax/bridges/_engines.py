"""Point generators of other libraries as sequences, and sequences of qmcjax as engines of scipy."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from qmcjax.core import checks
from qmcjax.integration import randomise
from qmcjax.sequences import Sequence, SequenceLike, as_sequence, tabulated


def tabulate(generator: Any, n: int) -> Sequence:
    """Make a sequence from the points that a generator of another library draws.

    Parameters
    ----------
    generator : object
        An engine of ``scipy.stats.qmc``, or any object with ``random(n)``, which draws the next points; or a
        discrete distribution of QMCPy [1]_, or any object with ``gen_samples(n)``, which draws the first
        points.
    n : int, number of points

    Returns
    -------
    Sequence
        A table of ``size`` n with only these points, rounded down to 32-bit fractions.

    Raises
    ------
    TypeError
        Also if the points are not floats.
    ValueError
        Also if they are not n points in [0, 1), as with replications or other distributions.

    Notes
    -----
    Prefer a sequence of qmcjax if available: it has random access and compiles into programs. Use this
    function for comparisons, and for other constructions.

    References
    ----------
    .. [1] S.-C. T. Choi et al., "QMCPy: A Quasi-Monte Carlo Python Library", https://qmcpy.org.

    Examples
    --------
    >>> from scipy.stats import qmc
    >>> print(tabulate(qmc.Halton(2, scramble=False), 4))
    tabulated(dims=2, size=4)
    """
    draws = (getattr(generator, name, None) for name in ("random", "gen_samples"))
    draw = next((each for each in draws if callable(each)), None)
    if draw is None or isinstance(generator, type):
        raise TypeError(
            "generator must be one of points, with random(n) as in scipy or gen_samples(n) as in QMCPy, got "
            f"{checks.shown(generator)}"
        )
    n = checks.integer("n", n, 1, checks.INDEX_LIMIT - 1)
    points = np.asarray(draw(n))
    if points.ndim != 2 or len(points) != n:
        raise ValueError(f"generator must draw points of shape ({n}, dims), got shape {points.shape}")
    try:
        return tabulated(points)
    except (TypeError, ValueError) as error:
        raise type(error)(f"generator: {error}") from None


class SequenceEngine(qmc.QMCEngine):
    """A sequence as an engine of ``scipy.stats.qmc``, for code that draws points block by block.

    Parameters
    ----------
    sequence : Sequence
        Any object that implements the protocol. Scrambling (``scramble`` in scipy) is part of the sequence.
    optimization : {None, "random-cd", "lloyd"}
        scipy's optimization of the points of each block.
    rng : optional
        For "random-cd", as in scipy; the sequence does not use it.
    seed : int, numpy.random.Generator or RandomState, optional
        Randomises the sequence again, like a replicate of :func:`qmcjax.integrate`, and replaces ``rng``.
        ``scipy.integrate.qmc_quad`` makes all its independent estimates this way, except for the first, which
        uses the given engine: pass one with a seed.

    Raises
    ------
    ValueError
        From ``random`` or ``fast_forward``, if there are no more points.

    Notes
    -----
    Conversely, :func:`tabulate` makes a sequence from an engine's points.

    Examples
    --------
    >>> from qmcjax import sequences
    >>> engine = SequenceEngine(sequences.sobol(2))
    >>> print(engine.fast_forward(1).random(2))
    [[0.5  0.5 ]
     [0.25 0.75]]
    """

    def __init__(
        self, sequence: SequenceLike, *, optimization: str | None = None, rng: Any = None, seed: Any = None
    ) -> None:
        sequence = as_sequence("sequence", sequence)
        if optimization is not None and not isinstance(optimization, str):
            raise TypeError(f"optimization must be None or a string, got {checks.shown(optimization)}")
        name, given = ("rng", rng) if seed is None else ("seed", seed)
        try:
            generator = np.random.default_rng(given)
        except (TypeError, ValueError) as error:
            raise type(error)(f"{name} must be one of NumPy, or a seed, got {checks.shown(given)}") from None
        super().__init__(d=sequence.dims, optimization=optimization, rng=generator)  # pyright: ignore
        self._init_quad = {"sequence": sequence, "optimization": optimization}  # scipy adds a seed to it.
        self.sequence = sequence
        if seed is not None:
            self.sequence = randomise(sequence, checks.prng_key("seed", int.from_bytes(self.rng.bytes(4))))

    def _random(self, n: Any = 1, *, workers: Any = 1) -> NDArray[np.float64]:
        self.num_generated = int(self.num_generated)  # scipy adds whatever integers it was given.
        n = checks.integer("n", n, 0, self.sequence.limit - self.num_generated)
        checks.integer("workers", workers, -1, checks.INDEX_LIMIT)
        if n == 0:
            return np.empty((0, self.d))
        return np.array(self.sequence.points(n, self.num_generated, np.float64))  # scipy writes to it.

    def fast_forward(self, n: Any) -> "SequenceEngine":
        """Skip points.

        Parameters
        ----------
        n : int, number of points

        Returns
        -------
        SequenceEngine
            This object.
        """
        left = self.sequence.limit - int(self.num_generated)
        self.num_generated += checks.integer("n", n, 0, left)
        return self
