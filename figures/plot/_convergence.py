"""Errors over numbers of samples, each curve with its name at its end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator
from matplotlib.transforms import blended_transform_factory
from numpy.typing import ArrayLike, NDArray

from analysis import ConvergenceTable
from figures._rc import COLUMN
from figures.plot._panels import check_texts, number, panel
from figures.plot._style import style
from qmcjax.core import checks
from qmcjax.core.parameters import known, numbers, require

_FEW_DECADES = 50.0
"""Up to this ratio of the ends of the vertical axis, powers of ten are too few ticks."""

_FEW_TICKS = 6.0
"""Up to this ratio, so are 1, 2 and 5 times powers of ten."""

_DIGIT = 0.8
"""Width of a digit and what parts it from others, in sizes of letters."""

_STEEPEST = 8.0
"""Largest power of the number of samples that is drawn."""

_RATE = "0.5"
_LINE = 1.35
"""Least distance of names, in sizes of their letters."""


def convergence(
    spps: Sequence[int] | ConvergenceTable,
    errors: Mapping[str, ArrayLike] | None = None,
    *,
    bands: Mapping[str, ArrayLike] | None = None,
    slopes: Sequence[float] = (-0.5, -0.75),
    times: float = 0.0,
    floor: float | None = None,
    title: str = "",
    ylabel: str = "RMS error",
    region: str = "whole",
    among: Sequence[str] = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw errors over samples per pixel, both logarithmic, with the names of samplers beside their curves.

    Parameters
    ----------
    spps : sequence of int, or ConvergenceTable
        A table has errors; over keys, it also has bands, and intervals of slopes, which are named.
    errors : mapping of samplers' names to float ArrayLike, shape (len(spps),)
        Positive; NaN where a sampler has no such number of samples. Not beside a table.
    bands : mapping of names to float ArrayLike, shape (2, len(spps)), optional
        Lower and upper ends of confidence intervals over keys.
    slopes : sequence of float, optional
        Exponents of the number of samples, drawn as dotted lines from the largest first error.
    times : float, optional
        Errors are multiplied by this power of the number of samples, so errors that fall like its inverse
        become horizontal, and small differences become visible.
    floor : float, optional
        The error of the reference, drawn as a line.
    title, ylabel : str, optional
    region : str, optional
        That of the errors of a table.
    among : sequence of str, optional
        All samplers of several plots, to give them the same styles; by default those of ``errors``.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError
        If ``errors`` is not a mapping, ``among`` is not made of names, or ``ax`` is not an Axes.
    ValueError
        If errors have another shape, or one is not positive.

    Examples
    --------
    >>> ax = convergence([1, 4, 16], {"Z": [0.3, 0.12, 0.05], "random": [0.3, 0.15, 0.08]})
    >>> print([text.get_text() for text in ax.texts if "n" not in text.get_text()])
    ['Z']
    """
    check_texts(title=title, ylabel=ylabel, region=region)
    labels: dict[str, str] = {}
    if isinstance(spps, ConvergenceTable):
        if errors is not None or bands is not None:
            name = "bands" if errors is None else "errors"
            raise ValueError(f"{name} must be None without numbers of samples, which a table has")
        spps, errors, bands, labels = _of_table(spps, region)
    for kind, given in (("errors", errors), ("bands", {} if bands is None else bands)):
        if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
            raise TypeError(f"{kind} must map names to {kind}, got {checks.shown(given)}")
    if not errors:
        raise ValueError("errors must be one or more, got {}")
    x = numbers("spps", known("spps", spps), (None,))
    require("spps", x, lambda n: n >= 1, "at least 1")
    powers = [
        number("slopes", power, -_STEEPEST, _STEEPEST) for power in np.atleast_1d(known("slopes", slopes))
    ]
    times = number("times", times, -_STEEPEST, _STEEPEST)
    floor = None if floor is None else number("floor", floor, 0)
    if not isinstance(among, tuple | list):
        raise TypeError(f"among must be names of samplers, got {checks.shown(among)}")
    of = {name: known(f"errors[{name!r}]", values) for name, values in errors.items()}
    for name, values in of.items():
        if values.shape != x.shape or not ((values > 0) | np.isnan(values)).all() or np.isnan(values).all():
            raise ValueError(f"errors[{name!r}] must be {len(x)} positive numbers, got {values.tolist()}")
    ax = panel(ax, (COLUMN, 2.5))
    scale = x**times
    of = {name: values * scale for name, values in of.items()}
    start = max(values[0] for values in of.values() if values[0] > 0)
    styles = {name: style(name, among or of) for name in of}
    named = [
        (labels.get(name, name), values[~np.isnan(values)][-1], styles[name].color)
        for name, values in of.items()
    ]
    for power in powers:
        rate = start * (x / x[0]) ** (power + times)
        ax.plot(x, rate, ":", color=_RATE, lw=0.8, zorder=0)
        named.append((f"rate $n^{{{power:g}}}$", rate[-1], _RATE))
    if floor:
        ax.plot(x, floor * scale, "-", color="0.6", lw=0.8, zorder=0)
        ax.annotate("error of the reference", (x[0], floor * scale[0]), color="0.4", va="bottom")
    for name, values in of.items():
        drawn = styles[name]
        there = ~np.isnan(values)
        ax.plot(x[there], values[there], drawn.line, color=drawn.color, marker=drawn.marker, ms=4, lw=1.2)
        if bands and name in bands:
            low, high = numbers(f"bands[{name!r}]", known("bands", bands[name]), (2, len(x))) * scale
            ax.fill_between(x, low, high, color=drawn.color, alpha=0.15, lw=0)
    ax.set_xscale("log", base=2)
    ax.set_yscale("log")
    texts = [f"{n:g}" for n in x]
    step = math.ceil(_DIGIT * max(map(len, texts)) * len(x) * mpl.rcParams["font.size"] / _points(ax)[0])
    ax.set_xticks(x, [text if k % step == 0 else "" for k, text in enumerate(texts)], minor=False)
    ax.minorticks_off()
    unit = f" $\\cdot\\, n^{{{times:g}}}$" if times else ""
    ax.set(xlabel="samples per pixel", ylabel=ylabel + unit, title=title)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high)  # Names are where curves end.
    if high < _FEW_DECADES * low:
        few = high < _FEW_TICKS * low
        ax.yaxis.set_major_locator(
            LogLocator(subs=(1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 8.0) if few else (1.0, 2.0, 5.0))
        )
    ax.yaxis.set_major_formatter("{x:g}")
    ax.grid(alpha=0.3)
    _names(ax, named)
    return ax


def _of_table(
    table: ConvergenceTable, region: str
) -> tuple[list[int], dict[str, NDArray], dict[str, NDArray], dict[str, str]]:
    """Return numbers of samples, errors, bands and names with slopes."""
    spps = list(dict.fromkeys(row.spp for row in table.rows))
    errors, bands, labels = {}, {}, {}
    for name in dict.fromkeys(row.sampler for row in table.rows):
        there, found = table.errors(name, region)
        errors[name] = np.full(len(spps), np.nan)
        errors[name][[spps.index(spp) for spp in there]] = np.where(found > 0, found, np.nan)
        labels[name], ends = name, table.bands(name, region)
        if len(there) > 1 and found.all():
            power = f"{table.slope(name, region):.2f}"
            if len(there) == len(spps) and np.isfinite(ends).all():
                bands[name] = ends
                low, high = table.slope_interval(name, region)
                power += rf" \pm {(high - low) / 2:.2f}"
            labels[name] = f"{name}: $n^{{{power}}}$"
    return spps, errors, bands, labels


def _points(ax: Axes) -> tuple[float, float]:
    """Return the width and the height of axes in points, before a layout moves them."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    scale = 72 / figure.dpi
    return scale * ax.bbox.width, scale * ax.bbox.height


def _names(ax: Axes, named: Sequence[tuple[str, float, str]]) -> None:
    """Write names, in their colours, right of where their curves end, apart from each other, with lines."""
    low, high = np.log(ax.get_ylim())
    ordered = sorted((float((np.log(end) - low) / (high - low)), name, color) for name, end, color in named)
    places = _apart([end for end, _, _ in ordered], _LINE * mpl.rcParams["font.size"] / _points(ax)[1])
    across = blended_transform_factory(ax.transAxes, ax.transAxes)
    for (end, name, color), place in zip(ordered, places, strict=True):
        ax.annotate(
            name,
            (1.0, end),
            xycoords=across,
            xytext=(1.06, place),
            textcoords=across,
            va="center",
            color=color,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": color,
                "lw": 0.6,
                "shrinkA": 1,
                "shrinkB": 2,
                "relpos": (0, 0.5),
            },
        )


def _apart(places: Sequence[float], line: float) -> NDArray[Any]:
    """Return places from 0 on near some that ascend, at least a line apart (pool adjacent violators)."""
    blocks: list[list[float]] = []  # sums of what is left of the steps, and how many
    for k, place in enumerate(places):
        blocks.append([place - k * line, 1])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] > blocks[-1][0] / blocks[-1][1]:
            total, count = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += count
    means = np.repeat([total / count for total, count in blocks], [int(count) for _, count in blocks])
    apart = means + np.arange(len(places)) * line
    return apart - min(apart[0], 0.0)
