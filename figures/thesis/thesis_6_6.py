"""Thesis Fig. 6.6: convergence on the Cornell box."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures._errors import fluctuation
from figures.making.schema import Claims
from figures.shared.rendered import motion_blur
from figures.shared.rendered.motion_blur import FULL, NETS

FEW = 8
"""Samples per pixel up to which there are few."""

WHY = (
    " On 256 x 256 pixels full-screen and rotated nets are within 7 % of each other at 2 to 64 samples, but "
    "the strongest waves are 43 to 110 over the full screen, against 9 to 12."
)
"""Of the sentences that do not hold."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log."""
    title = "The Cornell box: error over samples per pixel (thesis Fig. 6.6)"
    figure, numbers = motion_blur.convergence("cornell_box", title, (16, 7), _claims, quality, progress)
    return figure, numbers | {"note": numbers["note"] + WHY}


def _claims(errors: dict, waves: dict) -> Claims:
    lattice = errors["rank-1 lattice"]
    few = [spp for spp in errors[NETS[0]] if spp <= FEW]
    return {
        **motion_blur.claims_of_both(errors),
        "the modified net performs only marginally better than the original (by less than 10 %)": (
            motion_blur.slightly_smaller(errors, NETS[1], NETS[0])
        ),
        "the lattice even outperforms a net sometimes": any(
            lattice[spp] < errors[net][spp] for net in NETS for spp in lattice if spp > 1
        ),
        "its error does not decrease as smoothly": all(
            fluctuation(lattice) > fluctuation(errors[net]) for net in NETS
        ),
        "the full-screen nets perform worse than the rotated ones": motion_blur.smaller(errors, NETS, FULL),
        "at few samples full-screen nets show patterns, 1.5 times as strong as any of rotated ones": all(
            max(waves[full][spp] for spp in few) > 1.5 * max(waves[net][spp] for net in NETS for spp in few)
            for full in FULL
        ),
    }
