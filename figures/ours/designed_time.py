"""A tile designed over space and time beside what engines do from frame to frame: errors after filters."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from figures import plot
from figures.shared import integrands_of_dims
from qmcjax import samplers
from qmcjax.core import student

SIDE, FRAMES = {"draft": 32, "paper": 64}, 32
KEYS = {"draft": 4, "paper": 16}
ALPHA = 0.1
"""Part of a new frame in a moving average."""

GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
"""The golden ratio's kin in two dimensions: each frame shifts the first one's points."""

GOALS = (0.48, 0.34, 0.32, 0.56, 0.60)

Frames = NDArray[np.float64]
"""Shape (frames, rows, columns, ...)."""


def _moving(error: Frames) -> Frames:
    """Return the average that forgets, in the state that it reaches after many rounds of the frames."""
    weights = ALPHA * (1 - ALPHA) ** np.arange(6 * FRAMES)
    folded = weights.reshape(-1, FRAMES).sum(axis=0)
    transfer = np.fft.fft(folded / folded.sum())
    shape = (FRAMES,) + (1,) * (error.ndim - 1)
    return np.fft.ifft(np.fft.fft(error, axis=0) * transfer.reshape(shape), axis=0).real


def _space(error: Frames, time: float = 0.0) -> Frames:
    return gaussian_filter(error, (time, 1.5, 1.5, 0), mode="wrap")


FILTERS: dict[str, Callable[[Frames], Frames]] = {
    "space": _space,
    "space and\nmoving average": lambda error: _moving(_space(error)),
    "space and\nGaussian": lambda error: _space(error, 1.5),
    "moving\naverage": _moving,
    "8 frames": lambda error: error.reshape(-1, 8, *error.shape[1:]).mean(axis=1),
}

METHODS = ("designed tiles", "Z, golden shifts", "Z, new keys", "optimised orders, new keys", "random")

NOTE = (
    "{side} x {side} pixels, {frames} frames of one sample, {keys} keys. Root mean squares over half-"
    "spaces, balls, bumps and products in two dimensions, {count} of each, relative to random samples "
    "after the same filter. Filters in space are Gaussians of 1.5 pixels; the moving average takes "
    "{alpha} of each frame, the Gaussian in time has 1.5 frames. One tile of 32 x 32 pixels and 32 frames"
    " serves all filters, {values}; {goals} were asked, for other integrands. Beside Z with golden shifts"
    " its errors are {verdicts}. Samplers made"
    " for one frame are better in space alone."
)


def frames_of(name: str, side: int, key: int) -> Frames:
    """Return the points of all frames, shape (frames, rows, columns, 2)."""
    y, x = np.mgrid[:side, :side].astype(np.uint32)
    if name == "designed tiles":
        sampler = samplers.designed(side, side, 1, key, frames=FRAMES)
        return np.stack([np.asarray(sampler.at_frame(t)(x, y, 0)) for t in range(FRAMES)]).astype(float)
    if name == "random":
        return np.random.default_rng(key).random((FRAMES, side, side, 2))
    if name == "Z, golden shifts":
        first = np.asarray(samplers.z(side, side, 1, key)(x, y, 0), float)
        return (first + np.arange(float(FRAMES))[:, None, None, None] * GOLDEN) % 1
    made: Any = samplers.z if name == "Z, new keys" else samplers.optimized
    each = [made(side, side, 1, FRAMES * key + t)(x, y, 0) for t in range(FRAMES)]
    return np.stack([np.asarray(one, float) for one in each])


def errors(name: str, side: int, key: int) -> list[float]:
    """Return RMS errors over all integrands after each filter."""
    mean, deviation = integrands_of_dims.moments(2)
    points = jnp.asarray(frames_of(name, side, key).reshape(FRAMES * side, side, 2), jnp.float32)
    values = np.asarray(integrands_of_dims.values(points), float).reshape(FRAMES, side, side, -1)
    error = (values - mean) / deviation
    return [float(np.sqrt(np.square(of(error)).mean())) for of in FILTERS.values()]


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure all ways through the frames, and draw bars by filter."""
    side, keys, found = SIDE[quality], range(1, KEYS[quality] + 1), {}
    for name in METHODS:
        found[name] = np.array([errors(name, side, key) for key in keys])
        progress(len(found) / len(METHODS))
    white = np.sqrt(np.square(found["random"]).mean(axis=0))
    relative = {name: np.sqrt(np.square(of).mean(axis=0)) / white for name, of in found.items()}
    logs = np.log(found["designed tiles"] / found["Z, golden shifts"])
    intervals = [np.exp((of.mean(), *student.interval(of))) for of in logs.T]
    labels = [name.replace("\n", " ") for name in FILTERS]
    figure = Figure(figsize=(7.6, 3.8), layout="constrained")
    axes = figure.subplots()
    shown = METHODS[:-1]
    for k, name in enumerate(shown):
        across = np.arange(len(FILTERS)) + (k - 1.5) * 0.2
        style = plot.style(name.split(",")[0].replace("Z", "Z, hash"), ())
        color = {"Z, golden shifts": "#56B4E9"}.get(name, style.color)
        bars = axes.bar(across, relative[name], 0.19, color=color, label=name)
        axes.bar_label(bars, fmt="%.2f", fontsize=8, padding=1)
    axes.axhline(1, color="0.5", lw=0.8)
    axes.set(xticks=range(len(FILTERS)), ylabel="error, of random samples'", ylim=(0, 1.25))
    axes.set_xticklabels(FILTERS)
    axes.legend(ncols=2, frameon=False, fontsize=8, loc="upper left")
    figure.suptitle("One tile of points over space and time serves filters of both", fontsize=11)
    return figure, {
        "measured": {
            "error / random samples": {
                n: dict(zip(labels, map(float, of), strict=True)) for n, of in relative.items()
            },
            "designed / Z with golden shifts": {
                label: list(map(float, of)) for label, of in zip(labels, intervals, strict=True)
            },
        },
        "note": NOTE.format(
            side=side,
            frames=FRAMES,
            keys=len(keys),
            count=integrands_of_dims.COUNT,
            alpha=ALPHA,
            values=", ".join(
                f"{of:.2f} ({n})" for n, of in zip(labels, relative["designed tiles"], strict=True)
            ),
            goals=", ".join(map(str, GOALS)),
            verdicts=", ".join(f"{r:.2f} ({low:.2f} to {high:.2f})" for r, low, high in intervals),
        ),
    }
