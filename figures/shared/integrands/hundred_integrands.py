"""A hundred integrands of six classes in 1 to 8 dimensions, with values in [0, 1] and exact integrals."""

import math
from collections.abc import Callable
from functools import cache
from itertools import product
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

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
