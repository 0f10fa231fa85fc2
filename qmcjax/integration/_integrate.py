"""The mean of a function over the points of a sequence, without storing them."""

import math
import warnings
from collections.abc import Callable
from typing import Any, overload

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh
from jax.typing import ArrayLike, DTypeLike

from qmcjax.core import backends, checks, devices, draws
from qmcjax.core.pytrees import is_traced
from qmcjax.integration._boxes import over_box
from qmcjax.integration._estimate import Estimate, doublings, estimate, limits_of_integral, validate_limits
from qmcjax.integration._intervals import RULES
from qmcjax.integration._means import (
    ROWS,
    mean_of,
    prepare,
    refuse_infinite,
    some_values,
    value_range,
)
from qmcjax.sequences import (
    Interlaced,
    Multiples,
    Sequence,
    SequenceLike,
    as_sequence,
    interlaced,
    linear_matrix_scramble,
    owen,
    rotate,
)


@overload
def integrate(
    function: Callable[[Array], Any],
    sequence: SequenceLike,
    n: int,
    start: int = 0,
    *,
    replicates: None = None,
    key: None = None,
    bounds: ArrayLike | None = None,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Any: ...


@overload
def integrate(
    function: Callable[[Array], Any],
    sequence: SequenceLike,
    n: int,
    start: int = 0,
    *,
    replicates: int,
    key: Array | int,
    interval: str = "student",
    limits: tuple[float, float] | None = None,
    tolerance: float | None = None,
    bounds: ArrayLike | None = None,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Estimate: ...


def integrate(
    function: Callable[[Array], Any],
    sequence: SequenceLike,
    n: int,
    start: int = 0,
    *,
    replicates: int | None = None,
    key: Array | int | None = None,
    interval: str = "student",
    limits: tuple[float, float] | None = None,
    tolerance: float | None = None,
    bounds: ArrayLike | None = None,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Any:
    """Average a function over points of a sequence: quasi-Monte Carlo integration over the unit cube.

    Points are generated, evaluated and summed in blocks that stay in the cache. Memory does not depend on
    ``n``, even for gradients.

    Parameters
    ----------
    function : callable
        From points, shape (rows, dims), to values, shape (rows, ...), row by row: real numbers or bools, or a
        tuple, a dict or another pytree of them. The same function object compiles once. If it is a pytree,
        like a scene or ``jax.tree_util.Partial``, its arrays are parameters: new values do not recompile.
        Gradients flow to them, and to values that the function closes over.
    sequence : Sequence
        Or any object that implements the protocol, see :func:`qmcjax.sequences.as_sequence`. It must have
        ``start + n`` points.
    n : int
        Number of points, at least 1; with ``tolerance`` the largest number. A new n recompiles.
    start : int
        Index of the first point. Digital sequences in base 2 are faster for multiples of 4096.
    replicates : int, optional
        Number of randomised copies of the sequence, in [2, 65536], with ``n`` points each.
    key : jax.random.key, or int in [0, 2**32), randomises the replicates
    interval : str
        The guarantee of the estimate's ``interval()``:

        - "student": nominal coverage if the means of the replicates are nearly normal. The default, for 4 to
          32 replicates.
        - "median": the integral is the median of linearly scrambled replicates, for smooth functions much
          more accurate than their mean, and the interval lies between two of their order statistics. For
          smooth functions, its coverage tends to that of the binomial distribution as n grows [1]_. Requires
          a digital sequence in base 2, a power of two as n, and at least 6 replicates.
        - "quantile": the same for Owen-scrambled or rotated replicates. Whatever their distribution, it
          contains the *median* of a replicate's mean with at least the nominal probability. If the
          distribution is symmetric, this is the integral; otherwise the interval misses the integral as the
          number of replicates grows.
        - "betting": contains the integral with at least the nominal probability, for any number of points and
          replicates, and any function with values in ``limits`` [2]_. For any number of points per replicate,
          it is wider than the range of ``limits`` divided by the number of replicates: use many replicates
          with few points. Empirical Bernstein intervals [2]_ make the same assumptions and are 1.5 to 3.0
          times as wide. It assumes that replicates are independent, but nothing about the points within one:
          a digital structure does no harm. It contains the mean over the grid of the points, see Notes.
    limits : (float, float), optional
        Bounds of all values of the function. Required for "betting". Other
        intervals stay within them, and use them as the range of values that no replicate saw.
    tolerance : float, optional
        Start with 1024 points per replicate, and double their number until the integral is known within the
        tolerance, each of its numbers if there are several, or up to ``n``, which is rounded down to 1024
        times a power of two. Nothing may be traced.
        The estimate's ``n`` is the number used, and ``reason`` explains why it sufficed. A RuntimeWarning is
        emitted if the tolerance was not reached, or if this is uncertain.
    bounds : (float, float), or one such pair for each dimension, optional
        The box (low, high) to integrate over; the unit cube if None. The function then takes points of the
        box, rounded to ``dtype``, and the result is the integral, not the mean. Widths and volume come from
        float64. Finite bounds may be traced, and have derivatives. Infinite ends are mapped, see Notes.
    dtype : float32 or float64
        Dtype of points and, without ``replicates``, of sums. Sums are compensated, so they are as accurate as
        the values.
    mesh : jax.sharding.Mesh, optional
        Devices that share the points if there are many, as for :func:`qmcjax.render`. The integral is
        bit-identical on any number of devices.

    Returns
    -------
    Array, or pytree of them
        In the structure of the function's values, shape (...). Floats keep their dtype, others have
        ``dtype``. With ``replicates``, an :class:`Estimate`: their mean or median, the standard error, an
        ``interval()``, and whether it was ``reached``, in float64 for any ``dtype``. These are NumPy arrays
        unless traced.

    Raises
    ------
    ValueError
        If ``function`` returns NaN or infinity; the message names the point.

    Notes
    -----
    Replicates are Owen-scrambled (:func:`qmcjax.sequences.owen`) if the sequence has digits to scramble,
    before they are interlaced, and otherwise, as lattices, rotated (:func:`qmcjax.sequences.rotate`). They
    are independent, so their variance gives the standard error. Their points are the centres of cells of side
    2**-23 in float32 and 2**-32 in float64:
    each replicate is unbiased up to the curvature of the function in a cell, and up to the rounding of its
    values. Variation within a cell is invisible: in float32 bit 24 of every coordinate is 1, and intervals of
    any kind contain 1 instead of the mean 1/2 of that bit. The error ``rounding`` is the epsilon of the
    values, or of ``dtype`` if that is larger, times the mean magnitude of the values, plus half their range
    for jumps, since cells displace these by half their side; with ``bounds``, also the range times the part
    of a side by which rounding moves points. Where fewer than 1024 points along a side (or, if that is
    infinite, along a unit at its end) are different, ``reached`` is False. Magnitude and range are those of
    the first 4096 points of all replicates. Cancellation within the function is not accounted for.

    Intervals have their nominal coverage if the means of the replicates are nearly normal. Means of counts
    are not, and a few replicates may agree by chance. So if two means are equal, and at most half of the
    first 256 values are distinct, the interval grows by a rule of three for missed events: if an event is
    expected m times in each of R replicates, with a variance of at most m, all of them miss it with a
    probability of at most (1 + m)**-R, by Cantelli's inequality. Setting this to (1 - level) / 2 gives the
    largest m, and the half width m / n times the range of the values, which is combined with Student's as the
    root of the sum of squares: at 95 %, 6.1, 4.7 or 3.9 of the n * R values for R = 4, 8 or 32.
    (``standard_error`` includes the square root of 3 of them; "median" and "quantile" intervals add at least
    one per replicate.) The range is that of ``limits``, or else of the observed values. If these are all
    equal and there are no limits, no interval is reliable: ``reached`` is False, and ``interval()`` warns.

    The figure ``intervals`` measures coverage for indicators of 8 sets in 1 to 4 dimensions, with
    probabilities of 1e-6 to 1 - 1e-6, 2**4 to 2**16 points with 4 to 32 replicates, and 2**20 with 4 and 32:
    each 95 % interval contains the probability in 95 % of the trials up to chance (10 to 200 trials per
    case), or reports that it is unreliable. Sets that follow the digits of the points may have a larger
    variance. A smooth part hides rare events: for ``x + (x < 1e-4)`` no two means are equal, and without
    limits a missed event goes unnoticed; for ``x + (x < 1/3)`` with n = 256, the coverage of a 95 % interval
    is 80 % with 4 replicates and 93 % with 8. Skewed means are not corrected either: for ``-log x`` with
    n = 256, it is 90 %.

    Heavy tails make ``reached`` False: if values above v have a probability like v**(-1 / c), for c > 0.3
    ("quantile" and "median": c > 0.55), as estimated from the 128 largest of 4096 values. Of 60 keys with 8
    replicates of n = 256 points, this happens for all of x**-0.9 on (0, 1), where 95 % intervals contain the
    integral for 16, for 59 of x**-0.5 (44; those by "quantile" for 53), for 25 of x**-0.3 (49; 24 of the
    other 35), and for none of -log x. Peaks that few points hit look alike. Fewer than 512 values in all, and
    values that are mostly equal (counts, which are treated as above), give no such alarm.

    Infinite sides are mapped by x = low + u / (1 - u), x = high - (1 - u) / u, and for the whole line
    x = (1 / (1 - u) - 1 / u) / 2. Values are multiplied by the derivative; the product is bounded if they
    decrease like x**-2. Rescale functions with a scale far from 1. For other maps, call a warp of
    :mod:`qmcjax.warps` in the function and divide by its density. On the line, points reach up to 2**24 in
    float32 and 2**32 in float64.

    With ``tolerance``, the half width of an interval is compared with it after each doubling. All these
    intervals, of all numbers together, contain the integrals with a probability of 95 %: the level of each is
    1 - 0.05 / (number of possible sizes * numbers), so early stopping costs no coverage. If the tolerance is
    reached, the integral is within the tolerance of the midpoint of the last interval with that probability,
    as far as intervals have their nominal level: "student" relies on normal tails, "betting" only on
    ``limits``. Earlier points are reused: all replicates together use the estimate's ``n`` times
    ``replicates`` points.

    The figure ``intervals`` shows coverage and width of all kinds over 100 integrands in 1 to 8 dimensions.
    With 16 replicates of 1024 points, 95 % intervals by "median" have 0.6 times the width of Student's for
    smooth integrands and 0.3 for products, those by "quantile" 1.4 times. With 128 replicates of 128 points,
    those by "median" and "quantile" are 8 times as wide as Student's with 16 replicates for discontinuous
    integrands, and those by "betting" about 300 times for all.

    For smooth functions and kinks along the axes, a shifted lattice (:func:`qmcjax.sequences.cbc_lattice`)
    and a function of :func:`qmcjax.warps.tent` have a quarter of the error of Sobol' points, and for smooth
    functions of up to 3 dimensions so have interlaced nets (:func:`qmcjax.sequences.interlaced`), n = 4096;
    with more dimensions or kinks these have more (figure ``smooth``).

    With Owen scrambling the median gains nothing [3]_, so "median" scrambles linearly
    (:func:`qmcjax.sequences.linear_matrix_scramble`). The variance of the mean is the same, but much of it
    comes from rare replicates with a large error, which the median discards.

    References
    ----------
    .. [1] Z. Pan, "Quasi-Monte Carlo Confidence Intervals Using Quantiles of Randomized Nets", 2025,
       arXiv:2504.19138; Z. Pan, A. B. Owen, "Super-polynomial Accuracy of One Dimensional Randomized Nets
       Using the Median of Means", Math. Comput. 92, 2023.
    .. [2] I. Waudby-Smith, A. Ramdas, "Estimating Means of Bounded Random Variables by Betting", J. R. Stat.
       Soc. B 86, 2024; A. Jain, F. J. Hickernell, A. B. Owen, A. G. Sorokin, "Empirical Bernstein and Betting
       Confidence Intervals for Randomized Quasi-Monte Carlo", 2025, arXiv:2504.18677.
    .. [3] T. Goda, K. Suzuki, "The Median Trick Does not Help for Fully Nested Scrambling", 2025,
       arXiv:2507.04297.

    Examples
    --------
    >>> from qmcjax import integrate, sequences
    >>> print(integrate(lambda points: points[:, 0] * points[:, 1], sequences.sobol(2), 2**16))
    0.24999237
    >>> found = integrate(lambda points: points[:, 0] ** 2, sequences.sobol(1), 64, replicates=8, key=1)
    >>> low, high = found.interval(0.99)
    >>> print(bool(low < 1 / 3 < high), bool(high - low < 1e-2))
    True True
    """
    checks.function("function", function, "of points")
    sequence = as_sequence("sequence", sequence)
    n, start = checks.span(n, start, sequence)
    dtype = checks.floating(dtype)
    kind = checks.choice("interval", interval, RULES)
    limits = validate_limits(limits, kind, replicates)
    if replicates is None:
        if key is not None:
            raise ValueError(f"key must be None without replicates, got {checks.shown(key)}")
        if kind != "student":
            raise ValueError(f'interval must be "student" without replicates, got {interval!r}')
        copies = [sequence]
    else:
        replicates = checks.integer("replicates", replicates, 2, 2**16)
        keys = draws.split(checks.prng_key("key", key), replicates)
        copies = [randomise(sequence, each, kind) for each in keys]
    if tolerance is not None and is_traced((function, copies)):
        raise TypeError("tolerance must be None where the function or the sequence is traced")
    mesh = devices.validate_mesh(mesh)
    moved: Any = np.zeros(1)
    if bounds is not None:
        function, volume, moved = over_box(function, bounds, sequence.dims, dtype)
        if limits is not None:
            limits = limits_of_integral(limits, volume)
    with checks.precision(dtype):
        integrand, like = prepare(function, sequence.dims, dtype, replicates is not None)
    sizes, level = [n], 0.95
    if tolerance is not None:
        numbers = sum(math.prod(leaf.shape[1:]) for leaf in jax.tree.leaves(like))
        sizes, level = doublings(tolerance, n, replicates, kind, numbers)
    with checks.precision(dtype if replicates is None else jnp.float64):

        def means(start: int, n: int) -> list[Any]:
            aligned, found = start % backends.current().rows == 0, []
            for copy in copies:
                arguments = integrand, copy, np.uint32(start)
                how = n, aligned, mesh, is_traced(arguments)
                found.append(devices.local(mean_of(*devices.place(arguments, mesh), *how), mesh))
            for copy, columns in zip(copies, found, strict=True):
                refuse_infinite(columns, integrand, copy, start, n)
            return found

        found = means(start, sizes[0])
        if replicates is None:
            return found[0]
        few = copies[:_SHOWN]
        count = min(sizes[0], -(-ROWS // len(few)))
        some = jnp.concatenate([some_values(integrand, copy, jnp.uint32(start), count)[1] for copy in few])
        some = jax.lax.stop_gradient(some)
        spread = jnp.ptp(some, axis=0)
        settings = {"kind": kind, "limits": limits, "tolerance": tolerance, "level": level}

        def made_of(n: int) -> Estimate:
            nonlocal spread
            if limits is None:
                spread = value_range(spread, some, found, integrand, copies, start, n)
            return estimate(found, some, spread, like, moved, dtype, n=n, **settings)

        made = made_of(sizes[0])
        for size in sizes[1:]:
            if made.reached:
                break
            later = means(start + size // 2, size // 2)
            found = [(one + other) / 2 for one, other in zip(found, later, strict=True)]
            made = made_of(size)
        if tolerance is not None and not made.reached:
            warnings.warn(str(made.reason), RuntimeWarning, stacklevel=2)
        return made


_SHOWN = 16
"""Number of replicates whose first values give magnitudes and tails."""


def randomise(sequence: Sequence, key: Array, kind: str = "student") -> Sequence:
    """Return a randomised copy of a sequence, independent of those for other keys."""
    if isinstance(sequence, Interlaced):
        return interlaced(randomise(sequence.sequence, key, kind), sequence.order)  # pyright: ignore[reportArgumentType]
    if kind == "median":
        try:
            return linear_matrix_scramble(sequence, key)  # pyright: ignore[reportArgumentType]
        except TypeError as error:
            raise ValueError(f'interval must not be "median": {error}') from None
    if isinstance(sequence, Multiples):
        return rotate(sequence, key)
    try:
        return owen(sequence, key)  # pyright: ignore[reportArgumentType]
    except TypeError:  # no digits
        return rotate(sequence, key)
