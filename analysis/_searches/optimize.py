"""Gradient descent on a measure of points, and on the permutations of Owen scrambling."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checks, draws

_BELOW_ONE = float(np.nextafter(1.0, 0.0))


class OptimizedPoints(NamedTuple):
    """Points with a small measure, and the history of the measure."""

    points: NDArray[np.float64]
    """Shape (n, d), in [0, 1)^d."""
    values: NDArray[np.float64]
    """The measure at the start and after each step: it never increases."""


def optimize_points(
    points: ArrayLike, measure: Callable[[Array], Array], steps: int, *, torus: bool = True
) -> OptimizedPoints:
    """Move points to decrease a differentiable measure, by a quasi-Newton method.

    Parameters
    ----------
    points : float ArrayLike, shape (n, d)
        The starting points, in [0, 1)^d: the method finds a local minimum near them.
    measure : callable
        From float64 points, shape (n, d), to a scalar that JAX differentiates. It and its gradient must be
        finite at the start. Examples: :func:`l2_star_discrepancy`, ``lambda p: -soft_min_distance(p)``, or
        the distance of ``point_spectrum(p, resolution)`` from a given spectrum.
    steps : int
        Maximum number of steps, at least 1; each takes one or a few values and gradients. The method stops
        earlier if the measure decreases by less than rounding.
    torus : bool
        Whether points that leave the cube re-enter on the opposite side, for periodic measures; otherwise
        they stop at its faces, below 1.

    Returns
    -------
    OptimizedPoints, ``points`` and ``values``

    Notes
    -----
    The method is L-BFGS-B [1]_ of ``scipy.optimize`` with JAX gradients. The points of a lattice or another
    symmetric set may be a saddle point with gradient 0: perturb them first. Steps with a non-finite value,
    for example where two points coincide, are rejected.

    References
    ----------
    .. [1] R. H. Byrd, P. Lu, J. Nocedal, C. Zhu, "A limited memory algorithm for bound constrained
       optimization", SIAM Journal on Scientific Computing 16(5), 1995.

    Examples
    --------
    >>> from analysis import periodic_discrepancy
    >>> start = np.array([[0.1, 0.2], [0.3, 0.4], [0.7, 0.6]])
    >>> result = optimize_points(start, periodic_discrepancy, steps=50)
    >>> print(bool(result.values[-1] < result.values[0]))
    True
    """
    from scipy.optimize import minimize

    start = _arguments.points(points).astype(np.float64)
    checks.function("measure", measure, "of points")
    torus = checks.flag("torus", torus)
    steps = checks.integer("steps", steps, 1, 2**31 - 1)
    differentiated = jax.jit(jax.value_and_grad(measure))

    def inside(flat: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = flat.reshape(start.shape)
        # The fractional part of a tiny negative number is rounded to 1.
        return np.minimum(moved - np.floor(moved), _BELOW_ONE) if torus else moved

    def value_and_gradient(flat: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        with jax.enable_x64(True):
            value, gradient = differentiated(inside(flat))
        value, gradient = float(value), np.asarray(gradient, np.float64)
        if np.isfinite(value) and np.isfinite(gradient).all():
            return value, gradient.ravel()
        # A finite wall: the line search backtracks from it, but would end at infinity.
        return (values[-1] + max(1.0, abs(values[-1])) if values else np.inf), np.zeros(start.size)

    flat = start.ravel()
    check_scalar(measure, start.shape)
    values: list[float] = []
    first, _ = value_and_gradient(flat)
    if not np.isfinite(first):
        raise ValueError("measure and its gradient must be finite at the start, got NaN or infinity")
    values.append(first)
    result = minimize(
        value_and_gradient,
        flat,
        jac=True,
        method="L-BFGS-B",
        bounds=None if torus else [(0.0, _BELOW_ONE)] * start.size,
        callback=lambda intermediate_result: values.append(float(intermediate_result.fun)),
        options={"maxiter": steps, "maxfun": 20 * steps, "ftol": 0.0, "gtol": 0.0},
    )
    return OptimizedPoints(inside(result.x), np.array(values))


def check_scalar(measure: Callable[[Array], Array], shape: tuple[int, ...]) -> None:
    """Raise a ValueError unless a measure of float64 points is a floating point scalar."""
    with jax.enable_x64(True):
        like = jax.eval_shape(measure, jax.ShapeDtypeStruct(shape, np.float64))
    if getattr(like, "shape", None) != () or not np.issubdtype(like.dtype, np.floating):
        raise ValueError(f"measure must return a floating point scalar, got {like}")


Floats = NDArray[np.float64]

_RATE, _FIRST, _SECOND, _TINY = 0.1, 0.9, 0.99, 1e-12
"""Parameters of Adam: the learning rate, the decay of both moments, and the term against division by zero."""


class OptimizedScrambling(NamedTuple):
    """A net with a small measure, and the history of the measure."""

    points: NDArray[np.int64]
    """Shape (n, d): coordinates times n, rounded down. Row k is the scrambled row k of the given points."""
    values: Floats
    """The measure of the given points, and of the best so far after each net: it never increases."""


class Relaxed(NamedTuple):
    """Points as functions of a number from -1 to 1 for each node of each coordinate's binary tree.

    A node represents a digit of all numbers that share the digits above it; 1 keeps this digit, -1 flips it.
    In between, the digit is between 0 and 1: its mean, if it is flipped with that probability.
    """

    node: NDArray[np.int64]
    """The node of each digit in its tree, shape (n, d, m)."""
    digit: Floats
    """Digits as -1 and 1, times their weights: shape (n, d, m)."""

    def __call__(self, kept: Array | Floats) -> Array:
        """Return the points at numbers of shape (d, n - 1); for -1 and 1, centres of cells of side 1 / n.

        Digit k, counted from 1, is (1 + kept * digit) / 2 and weighs 2^-k. Half a cell and the halves of all
        digits sum to 1/2.
        """
        tree = np.arange(self.node.shape[1])[None, :, None]
        return 0.5 + jnp.sum(jnp.asarray(kept)[tree, self.node] * self.digit, axis=-1)


def relax(points: NDArray[np.int64]) -> Relaxed:
    """Return the points of a set of 2^m as a function of what scrambling does."""
    digits = len(points).bit_length() - 1
    k = np.arange(digits)
    above = points[..., None] >> (digits - k)
    digit = points[..., None] >> (digits - 1 - k) & 1
    return Relaxed((1 << k) - 1 + above, (2.0 * digit - 1) * 0.5 ** (k + 2))


def optimize_scrambling(
    points: ArrayLike, measure: Callable[[Array], Array], steps: int, key: Array | int = 0
) -> OptimizedScrambling:
    """Scramble a net to decrease a differentiable measure, by the gradient of relaxed permutations.

    Parameters
    ----------
    points : int ArrayLike, shape (n, d), coordinates times n, in [0, n), of n = 2^m points, m from 1 to 16
    measure : callable
        From float64 points, shape (n, d), at the centres of their cells, to a scalar that JAX differentiates,
        for example :func:`l2_star_discrepancy`. It and its gradient must be finite for the given points. It
        may depend on the order of the points, as errors of pixels do.
    steps : int
        Number of values with gradients in the descent, at least 1. At most three times as many values follow.
    key : jax.random.key, or int in [0, 2**32), for the initial scrambling

    Returns
    -------
    OptimizedScrambling
        ``points`` as exact integers, and ``values``. These are the given points if none are better.

    Notes
    -----
    Owen scrambling [1]_ flips a digit or not, for each node of each coordinate's tree of digits. If a digit b
    is flipped with probability s, the sigmoid of a parameter, its mean is b + s - 2 b s: points are then
    smooth functions of all d (n - 1) parameters. Such means are not a net, and their minima are not those of
    nets. Hence the measure is evaluated with all s rounded, and only its derivative uses the means [2]_
    (straight-through estimator); the descent is Adam [3]_. Then, starting at the best net, the flips with the
    largest predicted gain are tried together, as many as have been successful before, until no single one
    helps. Where ``values`` decreases after the first ``1 + steps``, a gradient was evaluated, too.

    All points tried are scramblings of the given ones: each (t,m,s)-net keeps its t.

    References
    ----------
    .. [1] A. B. Owen, "Randomly permuted (t,m,s)-nets and (t,s)-sequences", 1995.
    .. [2] Y. Bengio, N. Leonard, A. Courville, "Estimating or propagating gradients through stochastic
       neurons for conditional computation", 2013: the straight-through estimator.
    .. [3] D. P. Kingma, J. Ba, "Adam: a method for stochastic optimization", 2015.

    Examples
    --------
    >>> from analysis import l2_star_discrepancy, t_value
    >>> net = np.array([[0, 0], [1, 2], [2, 1], [3, 3]])
    >>> result = optimize_scrambling(net, l2_star_discrepancy, steps=20)
    >>> print(bool(result.values[-1] < result.values[0]), t_value(result.points / 4))
    True 0
    """
    given = _validate_net(points)
    checks.function("measure", measure, "of points")
    steps = checks.integer("steps", steps, 1, 2**31 - 1)
    key = checks.prng_key("key", key)
    n, dims = given.shape
    form = relax(given)
    with jax.enable_x64(True):
        start = np.asarray(draws.normal(key, (dims, n - 1), np.float64)) / 2
    check_scalar(measure, given.shape)
    search = _Search(form, measure)
    unmoved = np.ones((dims, n - 1))
    value, slope = search.value_and_gradient(unmoved)
    if not (np.isfinite(value) and np.isfinite(slope).all()):
        raise ValueError("measure and its gradient must be finite for the given points, got NaN or infinity")
    best, least = _descend(search, start, steps)
    best, least = (best, least) if least < value else (unmoved, value)
    best = _flip(search, best, least, 3 * steps)
    with jax.enable_x64(True):
        middles = np.asarray(form(best)) * n
    # NaN is never less.
    return OptimizedScrambling(np.floor(middles).astype(np.int64), np.fmin.accumulate(search.values))


class _Search:
    """A measure of nets and its gradient, with all values so far."""

    def __init__(self, form: Relaxed, measure: Callable[[Array], Array]) -> None:
        def of(kept: Array) -> Array:
            return measure(form(kept))

        self._value, self._differentiated = jax.jit(of), jax.jit(jax.value_and_grad(of))
        self.values: list[float] = []

    def value(self, kept: Floats) -> float:
        with jax.enable_x64(True):
            self.values.append(float(self._value(kept)))
        return self.values[-1]

    def value_and_gradient(self, kept: Floats) -> tuple[float, Floats]:
        value, slope = self._both(kept)
        self.values.append(value)
        return value, slope

    def gradient(self, kept: Floats) -> Floats:
        """Return the gradient alone, where the value is known."""
        return self._both(kept)[1]

    def _both(self, kept: Floats) -> tuple[float, Floats]:
        with jax.enable_x64(True):
            value, slope = self._differentiated(kept)
        return float(value), np.asarray(slope)


def _descend(search: _Search, parameter: Floats, steps: int) -> tuple[Floats, float]:
    """Follow the gradient at rounded numbers as if it were that at tanh(parameter), which is 1 - 2 s.

    Return the best numbers on the way, and their measure.
    """
    first, second = np.zeros_like(parameter), np.zeros_like(parameter)
    best, least = parameter, np.inf
    for step in range(1, steps + 1):
        kept = np.where(parameter > 0, 1.0, -1.0)
        value, slope = search.value_and_gradient(kept)
        if value < least:
            best, least = kept, value
        slope = np.nan_to_num(slope) * (1 - np.tanh(parameter) ** 2)
        first = _FIRST * first + (1 - _FIRST) * slope
        second = _SECOND * second + (1 - _SECOND) * slope**2
        size = np.sqrt(second / (1 - _SECOND**step)) + _TINY
        # The rate falls to a tenth: at the end, few nodes change.
        rate = _RATE * (1 - 0.9 * step / steps)
        parameter = parameter - rate * first / (1 - _FIRST**step) / size
    return best, least


def _flip(search: _Search, kept: Floats, least: float, trials: int) -> Floats:
    """Flip the nodes with the largest predicted gain, many at a time or one by one, and return the best."""
    slope = search.gradient(kept)
    most = max(1, kept.size // 8)
    together, tried = most, np.zeros(kept.size, bool)
    for _ in range(trials):
        promised = np.where(tried, np.inf, (-2 * kept * slope).ravel())
        chosen = np.argsort(promised, kind="stable")[:together]
        chosen = chosen[promised[chosen] < 0]
        if len(chosen) == 0:
            break
        trial = kept.copy()
        trial.ravel()[chosen] *= -1
        value = search.value(trial)
        if value < least:
            kept, least, slope = trial, value, search.gradient(trial)
            together, tried[:] = min(2 * together, most), False
        elif len(chosen) > 1:
            together = max(1, len(chosen) // 4)
        else:
            tried[chosen] = True
    return kept


def _validate_net(points: ArrayLike) -> NDArray[np.int64]:
    """Return points as integers."""
    wanted = "integers in [0, n), shape (n, d)"
    given = checks.known_array("points", points, np.integer, wanted)
    n = len(given) if given.ndim == 2 else 0
    if given.ndim != 2 or given.shape[1] == 0 or not 2 <= n <= 2**16 or n & (n - 1):
        raise ValueError(f"points must have shape (n, d), n = 2**m for m in [1, 16], got {given.shape}")
    if given.min() < 0 or given.max() >= n:
        raise ValueError(f"points must be {wanted}, got {given.min()} to {given.max()} for n = {n}")
    return given.astype(np.int64)
