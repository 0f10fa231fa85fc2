"""A hundred integrands with exact integrals, and kinds of intervals over them: coverage and widths."""

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from itertools import product
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax import integrate, sequences
from qmcjax.core.pytrees import frozen_pytree

COUNT = 100
DIMS = 8
"""Of the points: integrands take the first of their coordinates."""


class Formula(NamedTuple):
    """Values of a point x, with parameters a and b of each coordinate, and t of all."""

    values: Callable[[Array, Array, Array, Array], Array]
    """Of arrays x, a, b, shape (..., dims), and t, shape (...), that broadcast: in [0, 1]."""
    integral: Callable[[NDArray[np.float64], NDArray[np.float64], float], float]
    """Over the unit cube, of a, b and t."""
    least: float
    most: float
    """``least`` and ``most`` are the range that each a is drawn from."""
    unused: float = 0.0
    """The a of coordinates that do not count."""
    power: float = 0.0
    """Drawn a are multiplied by this power of the number of coordinates, so that values do not vanish."""


def _cut_power(a: NDArray[np.float64], t: float, power: int) -> float:
    """Return the integral of (t - a . x)_+^power / power! over the unit cube, by inclusion and exclusion."""
    order = len(a) + power
    corners = product((0, 1), repeat=len(a))
    parts = ((-1) ** sum(v) * max(t - float(np.dot(a, v)), 0.0) ** order for v in corners)
    return math.fsum(parts) / math.factorial(order) / float(np.prod(a))


def _peak_integral(a: NDArray[np.float64], b: NDArray[np.float64], t: float) -> float:
    del t
    sides = [(math.erf(s * (1 - c)) + math.erf(s * c)) / s for s, c in zip(a, b, strict=True)]
    return math.prod(math.sqrt(math.pi) / 2 * side for side in sides)


def _wave_integral(a: NDArray[np.float64], b: NDArray[np.float64], t: float) -> float:
    del b
    return 0.5 + 0.5 * (np.exp(1j * t) * np.prod((np.exp(1j * a) - 1) / (1j * a))).real


FORMULAS = {
    "half-space": Formula(
        lambda x, a, b, t: (jnp.sum(a * x, axis=-1) < t).astype(x.dtype),
        lambda a, b, t: _cut_power(a, t, 0),
        0.5,
        1.5,
    ),
    "box": Formula(
        lambda x, a, b, t: jnp.all(x < a, axis=-1).astype(x.dtype),
        lambda a, b, t: math.prod(a),
        0.5,
        0.95,
        unused=2.0,
    ),
    "ramp": Formula(
        lambda x, a, b, t: jnp.maximum(1 - jnp.sum(a * x, axis=-1) / t, 0),
        lambda a, b, t: _cut_power(a, t, 1) / t,
        0.5,
        1.5,
    ),
    "wave": Formula(
        lambda x, a, b, t: (1 + jnp.cos(jnp.sum(a * x, axis=-1) + t)) / 2, _wave_integral, 0.5, 3.0
    ),
    "product": Formula(
        lambda x, a, b, t: jnp.prod((1 + a * (x - 0.5)) / (1 + a / 2), axis=-1),
        lambda a, b, t: math.prod(1 / (1 + a / 2)),
        0.2,
        1.9,
    ),
    "peak": Formula(
        lambda x, a, b, t: jnp.exp(-jnp.sum((a * (x - b)) ** 2, axis=-1)),
        _peak_integral,
        2.0,
        8.0,
        power=-0.5,
    ),
    "pole": Formula(
        lambda x, a, b, t: jnp.prod(a / (a + x), axis=-1),
        lambda a, b, t: math.prod(s * math.log1p(1 / s) for s in a),
        0.01,
        0.2,
        unused=1e30,
        power=1.0,
    ),
}

CLASSES = {
    "discontinuous": ("half-space", "box"),
    "kinks": ("ramp",),
    "smooth": ("wave",),
    "products": ("product",),
    "peaks": ("peak",),
    "skewed": ("pole",),
}
"""Names of the formulas of each class, which take turns."""


@frozen_pytree
class Integrand:
    """A function of points; all integrands have the same program."""

    formula: Array
    """int32: number of the formula."""
    a: Array
    b: Array
    t: Array

    def __call__(self, points: Array) -> Array:
        """Return the values, shape (rows,), of points, shape (rows, DIMS)."""
        branches = [of.values for of in FORMULAS.values()]
        return jax.lax.switch(self.formula, branches, points, self.a[None], self.b[None], self.t[None])


class Exact(NamedTuple):
    """An integrand and its integral."""

    of_class: str
    formula: str
    dims: int
    integrand: Integrand
    integral: float


@cache
def integrands() -> tuple[Exact, ...]:
    """Return all integrands, those of a formula one after the other."""
    rng, places, made = np.random.default_rng(1), list(FORMULAS), []
    for number in range(COUNT):
        turn, which = divmod(number, len(CLASSES))
        of_class, names = list(CLASSES.items())[which]
        again, dim = divmod(turn, DIMS)
        name, dims = names[again % len(names)], dim + 1
        formula = FORMULAS[name]
        a = np.full(DIMS, formula.unused, np.float32)
        a[:dims] = rng.uniform(formula.least, formula.most, dims) * dims**formula.power
        b = rng.random(DIMS, np.float32)
        t = np.float32(rng.uniform(0.25, 0.75) * a[:dims].sum())
        wide_a, wide_b = (of[:dims].astype(np.float64) for of in (a, b))
        integral = formula.integral(wide_a, wide_b, float(t))
        function = Integrand(*map(jnp.asarray, (np.int32(places.index(name)), a, b, t)))
        made.append(Exact(of_class, name, dims, function, integral))
    return tuple(sorted(made, key=lambda exact: places.index(exact.formula)))


def together(points: Array) -> Array:
    """Return the values of all integrands, shape (rows, COUNT), in their order."""
    columns = []
    for name, formula in FORMULAS.items():
        of = [exact.integrand for exact in integrands() if exact.formula == name]
        a, b, t = (jnp.stack([getattr(each, part) for each in of])[None] for part in ("a", "b", "t"))
        columns.append(formula.values(points[:, None], a, b, t))
    return jnp.concatenate(columns, axis=1)


LEVEL, ALL = 0.95, "all"
FEW, MANY = "few", "many"
BERNSTEIN = "empirical Bernstein"
"""Not a kind of integrate: of the replicates of "betting"."""

CASES = (
    *((kind, FEW) for kind in ("student", "median", "quantile")),
    *((kind, MANY) for kind in ("student", "median", "quantile", "betting", BERNSTEIN)),
)
"""Kinds of intervals, and few or many replicates."""

REPLICATES = 8
"""With a tolerance."""

TOLERATED = 0.5
"""Tolerances are this part of the mean width of Student's intervals of few replicates."""

Case = tuple[str, str]


class Intervals(NamedTuple):
    """Intervals of all integrands over some keys."""

    held: NDArray[np.bool_]
    """Whether they hold the integral, shape (keys, integrands)."""
    width: NDArray[np.float64]
    """Shape (keys, integrands)."""


class Stopped(NamedTuple):
    """What came back for each key and integrand with a tolerance: arrays of shape (keys, integrands)."""

    held: NDArray[np.bool_]
    """Whether the last interval holds the integral."""
    within: NDArray[np.bool_]
    """Whether the middle of the last interval is within the tolerance of the integral."""
    reached: NDArray[np.bool_]
    n: NDArray[np.int64]
    of_class: NDArray[np.str_]
    """Shape (integrands,)."""


def bernstein(values: NDArray[np.float64], level: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the empirical Bernstein interval of the mean of values in [0, 1], by predictable weights.

    Of several such intervals this is the narrowest known: theorem 2 of Waudby-Smith and Ramdas, "Estimating
    Means of Bounded Random Variables by Betting", 2024. ``values``: shape (count, ...), to low and high.
    """
    count = len(values)
    number = np.arange(1, count + 1.0).reshape(count, *(1,) * (values.ndim - 1))
    mean = (0.5 + np.cumsum(values, axis=0)) / (number + 1)
    variance = (0.25 + np.cumsum((values - mean) ** 2, axis=0)) / (number + 1)
    mean, variance = (
        np.concatenate([np.full_like(of[:1], at), of[:-1]]) for of, at in ((mean, 0.5), (variance, 0.25))
    )
    needed = math.log(2 / (1 - level))
    weight = np.minimum(np.sqrt(2 * needed / (count * variance)), 0.5)
    penalty = ((values - mean) ** 2 * (-np.log1p(-weight) - weight)).sum(axis=0)
    half = (needed + penalty) / weight.sum(axis=0)
    middle = (weight * values).sum(axis=0) / weight.sum(axis=0)
    return np.maximum(middle - half, 0), np.minimum(middle + half, 1)


def measure(
    sizes: Mapping[str, tuple[int, int]], keys: Iterable[int], progress: Callable[[float], None]
) -> dict[Case, Intervals]:
    """Return the intervals of all cases. ``sizes``: few and many replicates, and points of each."""
    sequence, keys = sequences.sobol(DIMS), list(keys)
    exact = np.array([each.integral for each in integrands()])
    found: dict[Case, list[tuple]] = {case: [] for case in CASES}
    for k, key in enumerate(keys):
        for kind, size in CASES:
            if kind == BERNSTEIN:
                continue
            replicates, n = sizes[size]
            limits = (0.0, 1.0) if kind == "betting" else None
            made = integrate(
                together, sequence, n, replicates=replicates, key=key, interval=kind, limits=limits
            )
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "values are heavy-tailed")  # Right or not is counted here.
                found[kind, size].append(made.interval(LEVEL))
            if kind == "betting":
                found[BERNSTEIN, size].append(bernstein(np.asarray(made.means), LEVEL))
        progress((k + 1) / len(keys))
    ends = {case: np.asarray(of, np.float64) for case, of in found.items()}
    return {
        case: Intervals((of[:, 0] <= exact) & (exact <= of[:, 1]), of[:, 1] - of[:, 0])
        for case, of in ends.items()
    }


def stop_at_tolerance(
    kind: str,
    width: NDArray[np.float64],
    keys: Iterable[int],
    most: int,
    every: int,
) -> Stopped:
    """Integrate each integrand, or every other, ..., to its tolerance with at most so many points.

    ``width``: mean width of Student's intervals of each integrand.
    """
    sequence, keys = sequences.sobol(DIMS), list(keys)
    chosen = list(zip(integrands(), TOLERATED * width, strict=True))[::every]
    level = 1 - (1 - LEVEL) / (1 + max(0, most.bit_length() - 11))  # of 1024 points, 2048, ...
    found = np.empty((len(keys), len(chosen), 4))
    for k, key in enumerate(keys):
        for j, (each, tolerance) in enumerate(chosen):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)  # "not reached" is counted here
                made = integrate(
                    each.integrand,
                    sequence,
                    most,
                    replicates=REPLICATES,
                    key=key,
                    interval=kind,
                    tolerance=float(tolerance),
                )
            low, high = map(float, made.interval(level))
            off = abs((low + high) / 2 - each.integral)
            found[k, j] = (
                low <= each.integral <= high,
                off <= tolerance,
                (high - low) / 2 <= tolerance,
                made.n,
            )
    held, within, reached, n = np.moveaxis(found, -1, 0)
    classes = np.array([each.of_class for each, _ in chosen])
    return Stopped(held > 0, within > 0, reached > 0, n.astype(int), classes)


def by_class(values: NDArray, classes: NDArray[np.str_]) -> dict[str, float]:
    """Return the means over keys and the integrands of each class, and over all integrands."""
    means = {name: float(values[:, classes == name].mean()) for name in dict.fromkeys(classes.tolist())}
    return means | {ALL: float(values.mean())}
