"""Points for smooth integrands and for kinks: scrambled nets, interlaced nets, and shifted lattices."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures.shared.sheets.panels import new_figure
from qmcjax import sequences, warps
from qmcjax.core.pytrees import jit

KEYS = {"draft": 16, "paper": 64}
SIZES = {
    "draft": tuple(2**m for m in range(6, 13, 2)),
    "paper": tuple(2**m for m in range(6, 17, 2)),
}
DIMS = (3, 6)

RESAMPLED = 400
"""Draws of keys for the intervals of slopes and ratios."""


def _smooth(points: Array) -> Array:
    return jnp.exp(points.sum(axis=-1)) / (np.e - 1) ** points.shape[-1] - 1


def _kinks(points: Array) -> Array:
    return jnp.prod(1 + abs(points - 0.3) - 0.29, axis=-1) - 1


INTEGRANDS: dict[str, Callable[[Array], Array]] = {"exp of the sum": _smooth, "kinks": _kinks}
"""With integral 0."""


def _owen(n: int, dims: int, key: Array) -> sequences.Sequence:
    return sequences.owen(sequences.sobol(dims), key)


def _interlaced(n: int, dims: int, key: Array, order: int) -> sequences.Sequence:
    return sequences.interlaced(sequences.owen(sequences.sobol(dims * order), key), order)  # pyright: ignore[reportArgumentType]


def _lattice(n: int, dims: int, key: Array) -> sequences.Sequence:
    return sequences.rotate(sequences.cbc_lattice(n, dims), key)


USUAL = "Sobol', Owen"

WAYS: dict[str, tuple[Callable[..., sequences.Sequence], bool]] = {
    USUAL: (_owen, False),
    "interlaced, order 2": (partial(_interlaced, order=2), False),
    "interlaced, order 3": (partial(_interlaced, order=3), False),
    "lattice, shifted": (_lattice, False),
    "lattice, shifted, tent": (_lattice, True),
}
"""How a copy for a key is made, and whether the cube is folded."""

NOTE = (
    "RMS errors over {keys} keys. The lattices are made component by component for each number of points, "
    "weights 1/j^2. In the brackets: 95 % intervals, of slopes over all counts, and of errors over that of "
    "scrambled Sobol' points at the largest count, by drawing keys with replacement. The integrands are "
    "exp(x_1 + ... + x_d), and the product of 1 + |x_j - .3| - .29, both divided by their integral, minus 1."
)


@jit("sizes", "folded")
def _errors(copy: Any, sizes: tuple[int, ...], folded: bool) -> Array:
    """Return means over the first points, shape (sizes, integrands)."""
    points = copy(jnp.arange(sizes[-1], dtype=jnp.uint32), None, jnp.float64)
    values = [integrand(warps.tent(points) if folded else points) for integrand in INTEGRANDS.values()]
    return jnp.array([[of[:n].mean() for of in values] for n in sizes])


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure errors over keys, and draw them over the number of points."""
    sizes, keys = SIZES[quality], jax.random.split(jax.random.key(1), KEYS[quality])
    errors: dict[tuple[int, str], NDArray[np.float64]] = {}
    with jax.enable_x64(True):
        for done, (dims, name) in enumerate((d, name) for d in DIMS for name in WAYS):
            make_copy, folded = WAYS[name]
            together = [(n,) for n in sizes] if make_copy is _lattice else [sizes]
            found = [
                np.stack([_errors(make_copy(some[-1], dims, key), some, folded) for key in keys], axis=1)
                for some in together
            ]
            errors[dims, name] = np.concatenate(found)  # (sizes, keys, integrands)
            progress((done + 1) / (len(DIMS) * len(WAYS)))
    measured = {
        f"{integrand}, {dims} dimensions": {
            name: _summary(errors[dims, name][..., j], errors[dims, USUAL][-1, :, j], sizes) for name in WAYS
        }
        for dims in DIMS
        for j, integrand in enumerate(INTEGRANDS)
    }
    figure = new_figure(
        "For smooth integrands lattices with a tent beat Sobol' points, interlaced nets in 3-D only\n"
        f"RMS errors over {len(keys)} keys",
        5.6,
    )
    panels = figure.subplots(2, 2, sharex=True)
    for row, dims in zip(panels, DIMS, strict=True):
        for j, (panel, integrand) in enumerate(zip(row, INTEGRANDS, strict=True)):
            rms = {name: np.sqrt(np.mean(errors[dims, name][..., j] ** 2, axis=1)) for name in WAYS}
            plot.convergence(
                sizes, rms, slopes=(-1.5, -2.5), ax=panel, title=f"{integrand}, {dims} dimensions"
            )
            panel.set_xlabel("points" if dims == DIMS[-1] else "")
            shown = sizes[0], sizes[len(sizes) // 2], sizes[-1]
            panel.set_xticks(shown, map(str, shown))
    return figure, {"measured": measured, "note": NOTE.format(keys=len(keys))}


def _summary(
    errors: NDArray[np.float64], usual: NDArray[np.float64], sizes: tuple[int, ...]
) -> dict[str, Any]:
    """Return the slope and the error at the largest count over the usual one, with intervals over keys."""
    rng = np.random.default_rng(1)
    drawn = rng.integers(errors.shape[1], size=(RESAMPLED, errors.shape[1]))
    drawn[0] = np.arange(errors.shape[1])
    rms = np.sqrt(np.mean(errors[:, drawn] ** 2, axis=-1))
    slopes = np.polyfit(np.log(sizes), np.log(rms), 1)[0]
    ratios = rms[-1] / np.sqrt(np.mean(usual[drawn[[0, *range(RESAMPLED - 1, 0, -1)]]] ** 2, axis=-1))
    return {
        "error": float(rms[-1, 0]),
        "slope": [float(slopes[0]), *map(float, np.quantile(slopes, (0.025, 0.975)))],
        "error / Sobol'": [float(ratios[0]), *map(float, np.quantile(ratios, (0.025, 0.975)))],
    }
