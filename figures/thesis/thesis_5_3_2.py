"""Thesis Sect. 5.3.2: the permutation nets P_2 to P_5 in three dimensions, with their projections."""

from collections.abc import Callable

from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

PRINTED = {2: 6, 3: 12, 4: 38, 5: 90}
DECIMALS = {2: 0.6123724358, 3: 0.4330127019, 4: 0.3852758752, 5: 0.2964635307}
PLANES = ((0, 1), (0, 2), (1, 2))


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the three projections of each net."""
    figure, axes = point_plots.panels(
        12,
        "Permutation nets in three dimensions, $P_2$ to $P_5$, in the three planes (thesis Sect. 5.3.2)",
        columns=3,
    )
    measured: dict[str, dict] = {}
    planar: dict[str, dict[str, bool]] = {}
    for row, m in enumerate(PRINTED):
        net = sequences.permutation_net_3d(m)
        words = point_plots.words(net, m)
        points = words / 2**m
        squared = analysis.squared_min_distance(words, side=2**m)
        planar[f"P_{m}"] = {
            f"{'xyz'[a]}{'xyz'[b]}": point_plots.holds_one_each(points[:, [a, b]], m) for a, b in PLANES
        }
        measured[f"P_{m}"] = {"squared distance": squared, "t": analysis.t_value(points)}
        for column, (a, b) in enumerate(PLANES):
            panel = axes[3 * row + column]
            point_plots.grid(panel, 2**m, 2**m)
            title = f"$P_{m}$, {'xyz'[a]}{'xyz'[b]}, squared distance {squared} / $2^{{{2 * m}}}$"
            point_plots.scatter(panel, (words[:, [a, b]] + 0.5) / 2**m, title)
    return figure, {
        "measured": measured,
        "printed": {
            f"P_{m}": {"squared distance": value, "decimals": DECIMALS[m]} for m, value in PRINTED.items()
        },
        "claims": {
            "they have the printed distances": {
                f"P_{m}": measured[f"P_{m}"]["squared distance"] == value for m, value in PRINTED.items()
            },
            "the printed decimals are those of the roots": {
                f"P_{m}": abs(DECIMALS[m] - value**0.5 / 2**m) < 0.51e-10 for m, value in PRINTED.items()
            },
            "they are (0,m,3)-nets": {name: of["t"] == 0 for name, of in measured.items()},
            "all projections are (0,m,2)-nets": {name: all(of.values()) for name, of in planar.items()},
        },
        "note": "Points are drawn in the centres of their cells. Two of the printed decimals have a wrong "
        "tenth digit: sqrt(6)/4 = 0.6123724357, sqrt(90)/32 = 0.2964635306.",
    }
