"""Thesis Fig. 5.22: power spectra of two-dimensional nets."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

import analysis
from figures import _points
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
    del quality  # Exact, and quick at full size.
    figure, axes = _points.panels(
        len(NETS), "Power spectra of nets, P = 1 for white noise, |k| up to 128 (thesis Fig. 5.22)", columns=3
    )
    measured: dict[str, dict[str, float]] = {}
    for k, (name, (net, m)) in enumerate(NETS.items()):
        spectrum = np.array(analysis.point_spectrum(_points.block(net(m), 2**m), 2 * HIGHEST + 1))
        spectrum[0, 0] = 0.0
        axes[k].imshow(
            np.fft.fftshift(spectrum),
            cmap="gray",
            vmax=LARGEST_SHOWN,
            origin="lower",
            extent=(-HIGHEST - 0.5, HIGHEST + 0.5, -HIGHEST - 0.5, HIGHEST + 0.5),
        )
        axes[k].set_title(name, fontsize=9)
        axes[k].set(xticks=[-HIGHEST, 0, HIGHEST], yticks=[-HIGHEST, 0, HIGHEST])
        measured[name] = _statistics(spectrum, 2**m)
        progress((k + 1) / len(NETS))
    figure.colorbar(axes[0].images[0], ax=figure.axes, shrink=0.6, label="P, white from 32 on")
    numbers = {
        "measured": measured,
        "claims": {
            "permutation nets have a pronounced structure: peaks above half of a lattice's": {
                name: of["highest power / n"] > 0.5
                for name, of in measured.items()
                if name.startswith("permutation")
            },
            "the spectra of matrix-generated nets are less concentrated than those of permutation nets": {
                name: of[SHARE]
                < min(measured[net][SHARE] for net in measured if net.startswith("permutation"))
                for name, of in measured.items()
                if not name.startswith("permutation")
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
