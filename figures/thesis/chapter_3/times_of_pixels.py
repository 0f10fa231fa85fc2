"""At which time pixels are sampled: frameless rendering by a net, other ways (Sect. 3.1, Fig. 3.5)."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

import analysis
import qmcjax as qj
from figures._errors import rms
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import samplers, scenes, sequences

SIDE_3_1_7 = 128
KEYS = {"draft": 4, "paper": 32}
"""Of what is random: numbers are means over them."""
PARTS = {"1/16": 16, "1/4": 4, "1/2": 2}
BALL_3_1_7 = scenes.ball([[0.2, 0.35]], [[0.8, 0.65]], times=[], radius=0.12)

RANDOM = 2.0
"""Up to so many times the strongest wave of random pixels, an order is seemingly random."""

NOTE_3_1_7 = (
    "{side} x {side} pixels. Position i is the pixel that holds point i of the Sobol' sequence, which "
    "is computed on its own; its first {side}^2 points are a (0,m,2)-net, m = {m}, which has one point "
    "in each pixel. Owen-scrambled: the same with another key, a random net. Numbers are means over "
    "{keys} keys, except for Sobol'. One picture dissolves into another. The largest gap is the largest "
    "distance, in pixels, to the nearest updated pixel, on the torus; the error is that of the new "
    "picture if other pixels show the nearest updated one. The strongest wave is the largest power of "
    "the mask of updated pixels over its mean, about ln({side}^2 / 2) = {log:.0f} for random pixels. "
    "Frameless: each pixel shows a moving disc at the time at which it is updated, one sample for a "
    "whole shutter; the filtered error compares with exact motion blur, after a Gaussian of 1.5 pixels."
)


def thesis_3_1_7(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Dissolve pictures and render frameless, in the orders of nets and at random."""
    keys = KEYS[quality]
    orders = {
        "Sobol'": [_of_points(sequences.sobol(2))],
        "Owen-scrambled": [_of_points(sequences.owen(sequences.sobol(2), key)) for key in range(keys)],
        "random": [np.random.default_rng(key).permutation(SIDE_3_1_7**2) for key in range(keys)],
    }
    progress(0.3)
    old, new = _pictures()
    blurred = BALL_3_1_7.reference(SIDE_3_1_7, SIDE_3_1_7)[0]
    panels, measured, each_once = [], {}, {}
    for done, (name, pixels) in enumerate(orders.items(), start=1):
        each_once[name] = all(np.array_equal(np.sort(order), np.arange(SIDE_3_1_7**2)) for order in pixels)
        found = [[_measures(order[: SIDE_3_1_7**2 // n], new) for n in PARTS.values()] for order in pixels]
        means = np.mean(found, axis=0)
        frames = [_frameless(order) for order in pixels]
        filtered = [analysis.filtered_error(frame, blurred) for frame in frames]
        measured[name] = {
            part: dict(zip(("largest gap", "error", "strongest wave"), map(float, of), strict=True))
            for part, of in zip(PARTS, means, strict=True)
        } | {"frameless": {"filtered error": rms(filtered)}}
        for part, n in PARTS.items():
            of, image = measured[name][part], old.copy()
            image.ravel()[pixels[0][: SIDE_3_1_7**2 // n]] = new.ravel()[pixels[0][: SIDE_3_1_7**2 // n]]
            if n > 2:
                caption = f"{name}, {part}\nhole {of['largest gap']:.2f}, error {of['error']:.3f}"
                panels.append(Panel(caption, image))
        of_frame = measured[name]["frameless"]["filtered error"]
        panels.append(Panel(f"{name}, frameless\nfiltered error {of_frame:.4f}", frames[0]))
        progress(0.3 + 0.2 * done)
    title = (
        "Frameless rendering in the order of a net leaves smaller gaps than at random\n"
        f"thesis, Sect. 3.1.7; {SIDE_3_1_7} x {SIDE_3_1_7} pixels; "
        "1/16, 1/4: part of the pixels that are new; hole: largest distance to a new one; error: RMS"
    )
    figure = image_grid(title, panels, 3)
    numbers = {
        "measured": measured,
        "claims": _claims_3_1_7(measured, each_once),
        "note": NOTE_3_1_7.format(
            side=SIDE_3_1_7, m=(SIDE_3_1_7**2).bit_length() - 1, keys=keys, log=np.log(SIDE_3_1_7**2 / 2)
        ),
    }
    return figure, numbers


def _claims_3_1_7(measured: dict, each_once: dict[str, bool]) -> dict:
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
    x, y = np.floor(np.asarray(sequence.points(SIDE_3_1_7**2), np.float64).T * SIDE_3_1_7).astype(np.int64)
    return y * SIDE_3_1_7 + x


def _pictures() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x, y = np.meshgrid(*[(np.arange(SIDE_3_1_7) + 0.5) / SIDE_3_1_7] * 2)
    radius = np.hypot(x - 0.5, y - 0.5).astype(np.float64)
    return np.where(radius < 0.3, 0.35, 0.1), 0.75 + 0.25 * np.cos(40 * radius)


def _measures(updated: NDArray, new: NDArray) -> tuple[float, float, float]:
    """Return the largest gap, the error where gaps are filled in, and the strongest wave."""
    y, x = np.divmod(updated, SIDE_3_1_7)
    places = np.stack([x, y], axis=-1) + 0.5
    gap = SIDE_3_1_7 * analysis.dispersion(places / SIDE_3_1_7)
    rows, columns = np.divmod(np.arange(SIDE_3_1_7**2), SIDE_3_1_7)
    nearest = cKDTree(places).query(np.stack([columns, rows], axis=-1) + 0.5)[1]
    filled = new.ravel()[updated[nearest]]
    mask = np.zeros(SIDE_3_1_7**2)
    mask[updated] = 1
    wave = float(
        analysis.error_spectrum(
            mask.reshape(SIDE_3_1_7, SIDE_3_1_7), np.full((SIDE_3_1_7, SIDE_3_1_7), mask.mean())
        ).max()
    )
    return gap, rms(filled - new.ravel()), wave


def _frameless(order: NDArray) -> NDArray[np.float64]:
    """Return a moving disc, in each pixel at the time at which that is updated."""
    time = np.empty(SIDE_3_1_7**2)
    time[order] = np.arange(SIDE_3_1_7**2) / SIDE_3_1_7**2
    y, x = np.divmod(np.arange(SIDE_3_1_7**2), SIDE_3_1_7)
    points = np.stack([(x + 0.5) / SIDE_3_1_7, (y + 0.5) / SIDE_3_1_7, time], axis=-1)
    return np.asarray(BALL_3_1_7(jnp.asarray(points, jnp.float32)), np.float64).reshape(
        SIDE_3_1_7, SIDE_3_1_7
    )


KEY = 1
SPP = 32
SIDE_3_5 = {"draft": 160, "paper": 240}

BALL_3_5 = scenes.ball([[0.05, 0.2], [0.75, 0.95]], [[0.95, 0.5], [0.25, 0.75]], times=[0.5], radius=0.1)

STILL_SPP = 4

NOTE_3_5 = (
    "The scene is ours: a disc that crosses the picture, jumps, and crosses again. {spp} samples per "
    "pixel, {side} x {side} pixels, grey values from 0 to the highest. Positions inside the pixel are "
    "Owen-scrambled per pixel, but shared by all pixels in the accumulation buffer. 'filtered' is the "
    "RMS error after a Gaussian of 1.5 pixels, about what the eye sees. The last two: the disc in front "
    "of a zone plate, random samples. Where the disc passes, all {spp} samples also shade the zone "
    "plate, which has less noise there than elsewhere, with 4 samples; the variance invariant method "
    "takes 4 in both. Noise is measured between keys where the disc covers 0.5 to 30 %, relative to 4 "
    "samples alone."
)


def ways(spp: int, tile: int = 4) -> dict[str, Any]:
    """Return the samplers of Sect. 3.1."""
    times, own = sequences.van_der_corput(), samplers.independent(sequences.sobol(2), KEY)
    return {
        "same times in all pixels (dependent tests)": samplers.interleaved(times, spp, 1, own),
        "rotated in each pixel (Cranley-Patterson)": samplers.independent(
            sequences.sobol(3), KEY, randomize="shift"
        ),
        "interleaved, 4 x 4 pixels": samplers.interleaved(times, spp, tile, own),
        "accumulated images": samplers.interleaved(sequences.sobol(3), spp),
        "Owen-scrambled in each pixel": samplers.independent(sequences.sobol(3), KEY),
    }


def thesis_3_5(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render all ways, and the two adaptive ones, and measure their errors."""
    side = SIDE_3_5[quality]
    exact = BALL_3_5.reference(side, side)[0]
    images, errors = {"exact": exact}, {}
    for done, (name, sampler) in enumerate(ways(SPP).items(), start=1):
        image = np.asarray(qj.render(BALL_3_5, sampler, side, side, SPP), np.float64)
        images[name] = image
        errors[name] = {"rms": rms(image - exact), "filtered": analysis.filtered_error(image, exact)}
        progress(0.1 * done)
    layers, noise = _layers(side, exact, 32 if quality == "paper" else 12)

    title = (
        "Separate times in each pixel more than halve the filtered error of shared ones\n"
        f"thesis, Fig. 3.5 and Sect. 3.1; a disc that moves and jumps, {SPP} samples per pixel\n"
        "filtered error: RMS after a Gaussian of 1.5 pixels; last two: in front of a zone plate"
    )
    brightest = float(exact.max())
    panels = [Panel(f"exact; white: visible\n{100 * brightest:.0f} % of the time", exact, (0.0, brightest))]
    for name, of in errors.items():
        caption = f"{name.partition(' (')[0]}\nfiltered error {of['filtered']:.4f}"
        panels.append(Panel(caption, images[name], (0.0, brightest)))
    for name, image in layers.items():
        caption = f"{name}\nnoise on / off path {noise[name]:.2f}"
        panels.append(Panel(caption, image))
    figure = image_grid(title, panels, 4)
    numbers = {
        "measured": {"errors": errors, "noise on / off the path": noise},
        "claims": _claims_3_5(errors, noise),
        "note": NOTE_3_5.format(spp=SPP, side=side),
    }
    return figure, numbers


def _claims_3_5(errors: dict[str, dict[str, float]], noise: dict[str, float]) -> dict[str, Any]:
    same, rotated, interleaved, accumulated, _ = (of["filtered"] for of in errors.values())
    shaded, invariant = noise.values()
    return {
        "times of their own look better: less than half the filtered error": rotated < 0.5 * same,
        "interleaving reduces artefacts drastically: less than half the filtered error": (
            interleaved < 0.5 * same
        ),
        "accumulated images show them, too: more than twice the filtered error of times of their own": (
            accumulated > 2 * rotated
        ),
        "much less noise where all samples shade what is behind: less than half": shaded < 0.5,
        "even noise by the variance invariant method: within 10 %": abs(invariant - 1) < 0.1,
    }


def _layers(side: int, cover: NDArray, keys: int) -> tuple[dict[str, NDArray], dict[str, float]]:
    """Return an image of each adaptive way, and the noise of the still scene on the path over that off it."""
    plate = scenes.zone_plate(2.0 * side)

    def sampler(key: int) -> samplers.Sampler:
        return samplers.independent(sequences.uniform(3, key), key)

    def still(key: int, spp: int) -> NDArray[np.float64]:
        return np.asarray(qj.render(plate, sampler(key), side, side, spp), np.float64)

    def all_shade(key: int) -> NDArray[np.float64]:
        seen = np.asarray(qj.render(BALL_3_5, sampler(key), side, side, SPP), np.float64)
        behind = np.where(cover > 0, still(key, SPP), still(key, STILL_SPP))
        return seen + (1 - seen) * behind

    def invariant(key: int) -> NDArray[np.float64]:
        seen, behind = (
            np.asarray(qj.render_adaptive(scene, sampler(key), side, side, spp).image)
            for scene, spp in ((BALL_3_5, SPP), (plate, STILL_SPP))
        )
        return seen + (1 - seen) * behind

    alone = np.var([still(key, STILL_SPP) for key in range(keys)], axis=0, ddof=1)
    passed = (cover > 0.005) & (cover < 0.3)
    images, noise = {}, {}
    for name, render in {"all samples shade": all_shade, "variance invariant": invariant}.items():
        drawn = [render(key) for key in range(keys)]
        images[name] = drawn[0]
        noise[name] = float(np.sqrt(np.var(drawn, axis=0, ddof=1)[passed].mean() / alone[passed].mean()))
    return images, noise
