"""Thesis Fig. 6.8: convergence on the helicopter."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures.making.schema import Claims
from figures.shared.rendered import motion_blur
from figures.shared.rendered.motion_blur import (
    FULL,
    NETS,
    OTHERS,
    ratio,
    slightly_smaller,
    smaller,
    steeper,
    wins,
)

WHY = (
    " Up to 32 samples lattice and rotated nets are close, in favour of one or the other; from 64 on the "
    "lattice is behind. Which of the full-screen nets is better differs from count to count."
)
"""How narrowly sentences hold."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log."""
    title = "The helicopter: error over samples per pixel (thesis Fig. 6.8)"
    figure, numbers = motion_blur.convergence("helicopter", title, (16, 7), _claims, quality, progress)
    return figure, numbers | {"note": numbers["note"] + WHY}


def _claims(errors: dict, waves: dict) -> Claims:
    ahead = wins(errors, NETS, OTHERS)
    return {
        "the rotated nets outperform the others for almost all counts (all but one)": sum(ahead)
        >= len(ahead) - 1,
        "the lattice has more error than the nets": all(
            ratio(errors, "rank-1 lattice", net) > 1 for net in NETS + FULL
        ),
        "the full-screen nets perform better than the rotated ones": smaller(errors, FULL, NETS),
        "over the full screen the modified net performs slightly better": slightly_smaller(
            errors, *FULL[::-1]
        ),
        "the full-screen nets converge faster: a steeper slope": {
            net: steeper(errors, full, net) for full, net in zip(FULL, NETS, strict=True)
        },
        "nets and lattices are superior to random samples": {
            name: ratio(errors, name, "random") < 1 for name in (*NETS, *FULL, "rank-1 lattice")
        },
    }
