"""Thesis Fig. 5.5: minimum distances of two (0,m,3)-nets."""

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures._errors import residual
from figures.shared.sheets import point_plots
from figures.shared.sheets.curves import curve, name_axes, titled
from qmcjax import sequences

NETS = {"Sobol'": sequences.sobol_net_3d, "modified (C'1, C'2)": sequences.larcher_pillichshammer_net_3d}
STYLES = dict(zip(NETS, map(plot.style, ("Sobol' net", "modified Sobol' net")), strict=True))
PRINTED = {"Sobol'": 0.00358812, "modified (C'1, C'2)": 0.00926449}  # m = 13, caption of Fig. 5.9


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot the toroidal distances over m."""
    sizes = range(1, 24 if quality == "paper" else 17)
    squared: dict[str, list[int]] = {name: [] for name in NETS}
    for m in sizes:
        for name, net in NETS.items():
            points = point_plots.words(net(m), m)
            squared[name].append(analysis.squared_min_distance(points, side=2**m))
        progress(2.0 ** (m - sizes[-1]))
    distances = {name: np.sqrt(values) / 2.0 ** np.array(sizes) for name, values in squared.items()}

    title = "(0,m,3)-nets from the Sobol' and from the modified sequence (thesis Fig. 5.5)"
    figure = titled(title, 8, 5, fontsize=9)
    draw_distances(figure.subplots(), sizes, distances, STYLES)
    not_ahead = [m for m, a, b in zip(sizes, *squared.values(), strict=True) if b <= a]
    roughness = {name: residual(np.log(values)) for name, values in distances.items()}
    plain, modified = roughness.values()
    numbers = {
        "measured": {
            "squared distance on the integer grid": {
                name: dict(zip(map(str, sizes), values, strict=True)) for name, values in squared.items()
            },
            "distance at m = 13": {name: float(values[12]) for name, values in distances.items()},
            "modified is not ahead at m": not_ahead,
            "distance of logarithms from a straight line, root mean square": roughness,
        },
        "printed": {"distance at m = 13": PRINTED, "modified is not ahead at m": [5, 6]},
        "claims": {
            "the modified net is ahead, except for m = 5 and 6": {
                f"m = {m}": (m in not_ahead) == (m in (5, 6)) for m in sizes
            },
            "the distances at m = 13 are those printed": {
                name: abs(float(distances[name][12]) - value) < 0.6e-8 for name, value in PRINTED.items()
            },
            "the modified net's distance decreases smoothly, unlike that of the Sobol' net": (
                modified < 0.5 * plain
            ),
        },
        "note": "At m = 1 and 2 both nets have the same distance. The thesis goes up to m = 23, "
        "and so does paper quality; a draft goes to 16.",
    }
    return figure, numbers


def draw_distances(
    axes: Axes, sizes: range, distances: Mapping[str, NDArray], styles: Mapping[str, plot.Style]
) -> None:
    """Draw the distances of nets of 2**m points over m."""
    for name, values in distances.items():
        curve(axes, dict(zip(sizes, values, strict=True)), styles[name], ls="-", ms=6, lw=1.5, label=name)
    x, y = "m (the net has $2^m$ points)", "toroidal minimum distance in the unit cube"
    name_axes(axes, x, y, log="y", ticks=sizes, legend="best")
