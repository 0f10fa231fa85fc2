"""Thesis Fig. 5.22: power spectra of two-dimensional nets."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

import analysis
from figures.shared.sheets import point_plots
from figures.shared.sheets.image_sheets import Panel, image_grid
from qmcjax import sequences

NETS = {
    "Hammersley": (sequences.hammersley_net, 10),
    "Larcher-Pillichshammer": (sequences.larcher_pillichshammer_net, 10),
    "optimised matrices": (sequences.optimized_net, 10),
    "permutation, m = 10": (sequences.permutation_net, 10),
    "permutation, m = 11": (sequences.permutation_net, 11),
}
HIGHEST = 128
LARGEST_SHOWN = 32.0
SHARE = "share of power in the strongest 1 % of frequencies"


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the spectra, and measure how much of their power is in how few frequencies."""
    measured: dict[str, dict[str, float]] = {}
    panels = []
    for k, (name, (net, m)) in enumerate(NETS.items()):
        spectrum = np.array(analysis.point_spectrum(point_plots.block(net(m), 2**m), 2 * HIGHEST + 1))
        spectrum[0, 0] = 0.0
        measured[name] = of = _statistics(spectrum, 2**m)
        caption = (
            f"{name}, {2**m} points\nhighest P = {of['highest power / n']:.2f} n,\n"
            f"{of[SHARE]:.0%} of the power in the strongest 1 % of frequencies"
        )
        # Frequencies upward, as the thesis draws points.
        panels.append(Panel(caption, np.fft.fftshift(spectrum)[::-1], (0.0, LARGEST_SHOWN)))
        progress((k + 1) / len(NETS))
    title = (
        f"Power spectra of nets, P of white noise is 1 (thesis Fig. 5.22)\n|k| up to {HIGHEST} along both "
        f"axes, 0 in the middle; black is P = 0, white from {LARGEST_SHOWN:g} on"
    )
    figure = image_grid(title, panels, 3, 2 * (2 * HIGHEST + 1))
    permutations = [name for name in NETS if name.startswith("permutation")]
    numbers = {
        "measured": measured,
        "claims": {
            "permutation nets have a pronounced structure: peaks above half of a lattice's": {
                name: measured[name]["highest power / n"] > 0.5 for name in permutations
            },
            "the spectra of matrix-generated nets are less concentrated than those of permutation nets": {
                name: all(of[SHARE] < measured[net][SHARE] for net in permutations)
                for name, of in measured.items()
                if name not in permutations
            },
        },
        "note": "The mean, k = 0, is left out. The thesis shows 1024 points each, 2048 for m = 11; it names "
        "neither the range of frequencies nor the scale of its pictures.",
    }
    return figure, numbers


def _statistics(spectrum: np.ndarray, n: int) -> dict[str, float]:
    """Return the mean, the highest peak relative to a lattice's, and the share of the strongest 1 %."""
    ordered = np.sort(spectrum.ravel())[::-1]
    return {
        "mean power": float(ordered.sum() / (ordered.size - 1)),
        "highest power / n": float(ordered[0] / n),
        SHARE: float(ordered[: ordered.size // 100].sum() / ordered.sum()),
    }
