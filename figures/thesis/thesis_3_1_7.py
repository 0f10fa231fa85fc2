"""Thesis Sect. 3.1.7: in which order frameless rendering updates pixels, by a (0,m,2)-net or at random."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

import analysis
from figures._errors import rms
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import scenes, sequences

SIDE = 128
KEYS = {"draft": 4, "paper": 32}
"""Of what is random: numbers are means over them."""
PARTS = {"1/16": 16, "1/4": 4, "1/2": 2}
BALL = scenes.ball([[0.2, 0.35]], [[0.8, 0.65]], times=[], radius=0.12)

RANDOM = 2.0
"""Up to so many times the strongest wave of random pixels, an order is seemingly random."""

NOTE = (
    "{side} x {side} pixels. Position i is the pixel that holds point i of the Sobol' sequence, which is "
    "computed on its own; its first {side}^2 points are a (0,m,2)-net, m = {m}, which has one point in each "
    "pixel. Owen-scrambled: the same with another key, a random net. Numbers are means over {keys} keys, but "
    "for Sobol'. The pictures dissolve from one to another. The largest gap is the distance in pixels of the "
    "place that is farthest from the middles of the updated pixels, the screen repeated; the error is that "
    "of the new picture if pixels that are not updated show the nearest one that is. The strongest wave is "
    "the largest power of the updated pixels as a picture over its mean; of random pixels that is about "
    "ln({side}^2 / 2) = {log:.0f}. Frameless: each pixel shows a moving disc at the time at which it is "
    "updated, one sample for a whole shutter; the filtered error is against exact motion blur, after a "
    "Gaussian of 1.5 pixels."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Dissolve pictures and render frameless, in the orders of nets and at random."""
    keys = KEYS[quality]
    orders = {
        "Sobol'": [_of_points(sequences.sobol(2))],
        "Owen-scrambled": [_of_points(sequences.owen(sequences.sobol(2), key)) for key in range(keys)],
        "random": [np.random.default_rng(key).permutation(SIDE**2) for key in range(keys)],
    }
    progress(0.3)
    old, new = _pictures()
    blurred = BALL.reference(SIDE, SIDE)[0]
    panels, measured, each_once = [], {}, {}
    for done, (name, pixels) in enumerate(orders.items(), start=1):
        each_once[name] = all(np.array_equal(np.sort(order), np.arange(SIDE**2)) for order in pixels)
        found = [[_measures(order[: SIDE**2 // n], new) for n in PARTS.values()] for order in pixels]
        means = np.mean(found, axis=0)
        frames = [_frameless(order) for order in pixels]
        filtered = [analysis.filtered_error(frame, blurred) for frame in frames]
        measured[name] = {
            part: dict(zip(("largest gap", "error", "strongest wave"), map(float, of), strict=True))
            for part, of in zip(PARTS, means, strict=True)
        } | {"frameless": {"filtered error": rms(filtered)}}
        for part, n in PARTS.items():
            of, image = measured[name][part], old.copy()
            image.ravel()[pixels[0][: SIDE**2 // n]] = new.ravel()[pixels[0][: SIDE**2 // n]]
            caption = f"{name}, {part}\nhole {of['largest gap']:.2f}, error {of['error']:.3f}"
            panels.append(Panel(caption, image))
        of_frame = measured[name]["frameless"]["filtered error"]
        panels.append(Panel(f"{name}, frameless\nfiltered error {of_frame:.4f}", frames[0]))
        progress(0.3 + 0.2 * done)
    title = (
        f"Pixels updated in the order of a net, and at random, {SIDE} x {SIDE} pixels (thesis, Sect. 3.1.7)\n"
        "1/16, 1/4, 1/2: part of the pixels that are new; hole: largest distance to a new pixel; error: RMS"
    )
    figure = image_grid(title, panels, 4, 2 * SIDE)
    numbers = {
        "measured": measured,
        "claims": _claims(measured, each_once),
        "note": NOTE.format(side=SIDE, m=(SIDE**2).bit_length() - 1, keys=keys, log=np.log(SIDE**2 / 2)),
    }
    return figure, numbers


def _claims(measured: dict, each_once: dict[str, bool]) -> dict:
    nets = "Sobol'", "Owen-scrambled"
    random = measured["random"]

    def less(what: str, factor: float = 1.0) -> dict[str, bool]:
        return {
            f"{name}, {part}": measured[name][part][what] < factor * random[part][what]
            for name in nets
            for part in PARTS
        }

    return {
        "a net is a permutation of pixels": {name: each_once[name] for name in nets},
        "nets are well suited: smaller largest gaps than at random": less("largest gap"),
        "nets are well suited: less error of what is filled in than at random": less("error"),
        "nets are well suited: frameless motion blur has less filtered error than at random": {
            name: measured[name]["frameless"]["filtered error"] < random["frameless"]["filtered error"]
            for name in nets
        },
        "they are seemingly random: no wave is twice the strongest of random pixels": less(
            "strongest wave", RANDOM
        ),
    }


def _of_points(sequence: sequences.Sequence) -> NDArray[np.int64]:
    """Return the pixels that hold the first points of a sequence, as numbers in rows."""
    x, y = np.floor(np.asarray(sequence.points(SIDE**2), np.float64).T * SIDE).astype(np.int64)
    return y * SIDE + x


def _pictures() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a dark picture, and a light one that takes its place."""
    x, y = np.meshgrid(*[(np.arange(SIDE) + 0.5) / SIDE] * 2)
    radius = np.hypot(x - 0.5, y - 0.5).astype(np.float64)
    return np.where(radius < 0.3, 0.35, 0.1), 0.75 + 0.25 * np.cos(40 * radius)


def _measures(updated: NDArray, new: NDArray) -> tuple[float, float, float]:
    """Return the largest gap, the error where gaps are filled in, and the strongest wave."""
    y, x = np.divmod(updated, SIDE)
    places = np.stack([x, y], axis=-1) + 0.5
    gap = SIDE * analysis.dispersion(places / SIDE)
    rows, columns = np.divmod(np.arange(SIDE**2), SIDE)
    nearest = cKDTree(places).query(np.stack([columns, rows], axis=-1) + 0.5)[1]
    filled = new.ravel()[updated[nearest]]
    mask = np.zeros(SIDE**2)
    mask[updated] = 1
    wave = float(analysis.error_spectrum(mask.reshape(SIDE, SIDE), np.full((SIDE, SIDE), mask.mean())).max())
    return gap, rms(filled - new.ravel()), wave


def _frameless(order: NDArray) -> NDArray[np.float64]:
    """Return a moving disc, in each pixel at the time at which that is updated."""
    time = np.empty(SIDE**2)
    time[order] = np.arange(SIDE**2) / SIDE**2
    y, x = np.divmod(np.arange(SIDE**2), SIDE)
    points = np.stack([(x + 0.5) / SIDE, (y + 0.5) / SIDE, time], axis=-1)
    return np.asarray(BALL(jnp.asarray(points, jnp.float32)), np.float64).reshape(SIDE, SIDE)
