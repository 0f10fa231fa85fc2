"""Thesis Fig. 5.13 and 5.16: permutation nets of odd and even m."""

from collections.abc import Callable

from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from qmcjax import sequences

SIZES = (3, 5, 7, 4, 6, 8)
PRINTED = {3: 8, 5: 32, 7: 128, 4: 13, 6: 53, 8: 241}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the nets that the thesis draws."""
    figure, axes = point_plots.panels(
        6, "Permutation nets for odd and even m (thesis Fig. 5.13 and 5.16)", columns=3
    )
    measured: dict[str, int] = {}
    with_origin = {}
    for m, panel in zip(SIZES, axes, strict=True):
        net = sequences.permutation_net(m)
        words = point_plots.words(net, m)
        shear = 0 if m % 2 else 2 ** (m - 2)
        measured[str(m)] = analysis.squared_min_distance(words, side=2**m, shear=shear)
        with_origin[f"m = {m}"] = bool((words == 0).all(axis=1).any())
        point_plots.grid(panel, 2 ** (m // 2), 2 ** (m // 2))
        point_plots.scatter(
            panel,
            point_plots.block(net, 2**m),
            f"m = {m}, squared distance {measured[str(m)]} / $2^{{{2 * m}}}$",
        )
    return figure, {
        "measured": {"squared distance on the integer grid": measured},
        "printed": {"squared distance on the integer grid": {str(m): PRINTED[m] for m in SIZES}},
        "claims": {
            "squared distances are those of Table 5.1": {
                f"m = {m}": measured[str(m)] == PRINTED[m] for m in SIZES
            },
            "for even m no matrices generate them: the point (0, 0) is missing": {
                name: not found for name, found in with_origin.items() if int(name[-1]) % 2 == 0
            },
        },
        "note": "Even m with the sheared tiling.",
    }
