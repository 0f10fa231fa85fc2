"""One sample per pixel and frame: padded replications, Sobol' sequence (thesis Fig. 5.10 to 5.12)."""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
import qmcjax as qj
from figures.making.schema import Claims
from figures.shared.sheets import point_plots
from figures.shared.sheets.panels import new_figure
from qmcjax import samplers, scenes, sequences

SIDE, INSTANCES, DRAWS = 8, 4, 1000

SCREEN, COUNTS, KEYS = 64, (4, 16, 64), 8
"""Pixels a side of the images that compare random and low discrepancy shifts, samples, and random ones."""


def screen(sampler: samplers.Sampler, count: int) -> list[NDArray[np.float64]]:
    """Return the points on the screen of so many samples of all pixels."""
    y, x = (jnp.asarray(a.ravel()) for a in np.mgrid[0:SIDE, 0:SIDE].astype(np.uint32))
    pixels = np.stack([x, y], axis=1)
    return [
        (pixels + np.asarray(sampler(x, y, jnp.full_like(x, k), dtype=jnp.float64))) / SIDE
        for k in range(count)
    ]


def thesis_5_11(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four instances over 8 x 8 pixels, and all of them together."""
    net = sequences.larcher_pillichshammer_net(6)
    sampler = samplers.padded_replications(net, SIDE, SIDE, offsets=0)
    instances = screen(sampler, INSTANCES)
    together = np.concatenate(instances)
    shifts = np.asarray(sampler.offsets.points(INSTANCES, dtype=jnp.float64))[:, :2] * SIDE
    frames = np.asarray(sequences.sobol(2).points(SIDE * SIDE * INSTANCES, dtype=jnp.float64))
    hit = [len(np.unique(np.floor(points * SIDE), axis=0)) for points in instances]
    measured = {
        "pixels with one sample of each instance": hit,
        "shifts in pixels": shifts.astype(int).tolist(),
        "minimum distance of the net": analysis.min_distance(point_plots.block(net, net.size)),
        "minimum distance of each instance": [analysis.min_distance(i) for i in instances],
        "minimum distance superimposed": analysis.min_distance(together),
        f"the least of {DRAWS} draws of shifts, over that of ten": _closest(point_plots.block(net, net.size)),
        "the same of four frames of the Sobol' sequence": analysis.min_distance(frames),
        "RMS error of the checkerboard": _errors(),
    }
    title = (
        "Shifts keep the minimum distance of a net, but not its elementary intervals\n"
        "thesis, Fig. 5.11; padded replications: one net, shifted by whole pixels and jittered; t = 0: a net"
    )
    return _draw(title, "instance", instances), {
        "measured": measured,
        "claims": _claims(measured, [point_plots.holds_one_each(i, 6) for i in instances]),
        "note": "Toroidal minimum distances. The net is Larcher and Pillichshammer's, "
        "as in the programs of the thesis, which does not give the shifts. These keep distances, "
        "but not all elementary intervals. "
        f"Errors: {SCREEN} x {SCREEN} pixels, shifts and jitter of the Halton sequence against random ones, "
        f"the root mean square over {KEYS} keys.",
    }


def _closest(net: NDArray[np.float64]) -> float:
    """Return how much closer samples come in many draws of shifts than in ten: least distances."""
    shifts = np.random.default_rng(1).random((DRAWS, INSTANCES, 1, 2))
    found = np.array([analysis.min_distance((net + of).reshape(-1, 2) % 1) for of in shifts])
    return float(found.min() / found.reshape(-1, 10).min(axis=1).mean())


def _draw(title: str, name: str, sets: list[NDArray[np.float64]], middle: float = 0.0) -> Figure:
    """Draw sets of points over the pixels, moved by ``middle``, and all of them, with their measures."""
    together = np.concatenate(sets)
    return draw_sets(
        title,
        {f"{name} {k}\n{_quality(points)}": points + middle for k, points in enumerate(sets)},
        f"superimposed: {_quality(together)}",
        (SIDE, SIDE),
    )


def draw_sets(
    title: str, sets: Mapping[str, NDArray[np.float64]], all_of: str, cells: Sequence[int]
) -> Figure:
    """Draw four sets of points with their captions, and large all of them together, over cells of both."""
    figure = new_figure(title, 4.3)
    panels = figure.subplot_mosaic("abee;cdee", width_ratios=[1, 1, 1.15, 1.15])
    for letter, (caption, points) in zip("abcd", sets.items(), strict=True):
        color = f"C{'abcd'.index(letter)}"
        point_plots.scatter(panels[letter], points, caption, color=color, ms=3)
        point_plots.scatter(panels["e"], points, all_of, color=color, ms=4)
        point_plots.grid(panels[letter], cells[0], cells[0])
    point_plots.grid(panels["e"], cells[-1], cells[-1])
    return figure


def _quality(points: NDArray[np.float64]) -> str:
    return f"t = {analysis.t_value(points)}, distance {analysis.min_distance(points):.4f}"


def _claims(measured: dict, is_net: list[bool]) -> Claims:
    def each(holds: list[bool]) -> dict[str, bool]:
        return {f"instance {k}": held for k, held in enumerate(holds)}

    distances = measured["minimum distance of each instance"]
    random, halton = measured["RMS error of the checkerboard"].values()
    return {
        "one sample of each instance in each pixel": each(
            [count == SIDE**2 for count in measured["pixels with one sample of each instance"]]
        ),
        "shifts keep the minimum distance": each(
            [bool(np.isclose(d, measured["minimum distance of the net"], rtol=1e-12)) for d in distances]
        ),
        "shifts do not keep elementary intervals": each([not found for found in is_net]),
        "superimposed, samples lie arbitrarily close: of 1000 draws below a quarter of the least of ten": (
            measured[f"the least of {DRAWS} draws of shifts, over that of ten"] < 0.25
        ),
        "shifts of low discrepancy have less error than random ones": {
            spp: halton[spp] < random[spp] for spp in random
        },
    }


def _errors() -> dict[str, dict[str, float]]:
    """Return the errors of an image by the number of samples, by random shifts and by the Halton sequence."""
    scene = scenes.checkerboard()
    exact = scene.reference(SCREEN, SCREEN)[0]

    def square(offsets: sequences.Sequence | int, spp: int) -> float:
        net = sequences.larcher_pillichshammer_net(2 * (SCREEN.bit_length() - 1))
        sampler = samplers.padded_replications(net, SCREEN, SCREEN, offsets)
        return float(np.mean((np.asarray(qj.render(scene, sampler, SCREEN, SCREEN, spp)) - exact) ** 2))

    return {
        "random shifts": {
            f"{spp} spp": float(np.sqrt(np.mean([square(key, spp) for key in range(KEYS)]))) for spp in COUNTS
        },
        "shifts by the Halton sequence": {
            f"{spp} spp": float(np.sqrt(square(sequences.halton(4), spp))) for spp in COUNTS
        },
    }


FRAMES = 4


def thesis_5_12(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four frames of 8 x 8 pixels, and all of them together."""
    sampler = samplers.full_screen(sequences.sobol(2), SIDE, SIDE)
    frames = screen(sampler, FRAMES)
    together = np.concatenate(frames)
    net = sequences.larcher_pillichshammer_net(6)
    replicated = screen(samplers.padded_replications(net, SIDE, SIDE, offsets=0), FRAMES)
    measured = {
        "superimposed": _measures(together),
        "superimposed instances of Fig. 5.11": _measures(np.concatenate(replicated)),
        "first frame": _measures(frames[0]),
        "Larcher-Pillichshammer net": _measures(point_plots.block(net, 64)),
    }
    title = (
        "Frames of the Sobol' sequence are nets, superimposed a larger net\n"
        "thesis, Fig. 5.10 and 5.12; one sample per pixel in each frame; t = 0: a net"
    )
    # In the middle of the cells of all points.
    return _draw(title, "frame", frames, 0.5 / len(together)), {
        "measured": measured,
        "claims": {
            "one sample in each pixel, and each set well stratified: each frame is a (0,6,2)-net": {
                f"frame {k}": point_plots.holds_one_each(frame, 6) for k, frame in enumerate(frames)
            },
            "superimposed they form a larger net, a (0,8,2)-net": point_plots.holds_one_each(together, 8),
            "better stratified than those of Fig. 5.11": _better(
                measured["superimposed"], measured["superimposed instances of Fig. 5.11"]
            ),
            "a single set is not as good as Larcher and Pillichshammer's": _better(
                measured["Larcher-Pillichshammer net"], measured["first frame"]
            ),
        },
        "note": "The index follows from pixel and frame by solving linear equations over F2, without tables. "
        "Minimum distances are toroidal.",
    }


def _measures(points: NDArray[np.float64]) -> dict[str, float]:
    return {
        "t": analysis.t_value(points),
        "star discrepancy": analysis.star_discrepancy(points),
        "minimum distance": analysis.min_distance(points),
    }


def _better(one: dict[str, float], other: dict[str, float]) -> dict[str, bool]:
    """Tell by which measures one set of points is better than another."""
    return {
        "star discrepancy": one["star discrepancy"] < other["star discrepancy"],
        "minimum distance": one["minimum distance"] > other["minimum distance"],
    } | ({"t": one["t"] < other["t"]} if one["t"] != other["t"] else {})
