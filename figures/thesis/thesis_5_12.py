"""Thesis Fig. 5.10 and 5.12: one sample of the Sobol' sequence per pixel and frame."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.shared.sheets import point_plots
from figures.thesis.thesis_5_11 import SIDE, drawn, screen
from qmcjax import samplers, sequences

FRAMES = 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
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
    title = "One sample per pixel in each frame of the Sobol' sequence (thesis Fig. 5.10, 5.12)"
    return drawn(title, "frame", frames, middle=0.5 / len(together)), {
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
        "Distances are toroidal; D* is the star discrepancy.",
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
