"""Thesis Fig. 6.8: convergence on the helicopter."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures.making.schema import Claims
from figures.shared.rendered import motion_blur
from figures.shared.rendered.motion_blur import FULL, NETS

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
    return {
        **motion_blur.claims_of_both(errors),
        "the lattice has more error than the nets": all(
            motion_blur.ratio(errors, "rank-1 lattice", net) > 1 for net in NETS + FULL
        ),
        "the full-screen nets perform better than the rotated ones": motion_blur.smaller(errors, FULL, NETS),
        "over the full screen the modified net performs slightly better": motion_blur.slightly_smaller(
            errors, *FULL[::-1]
        ),
    }
