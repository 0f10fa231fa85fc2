"""The Cornell box and the helicopter: images, convergence, claims (thesis Fig. 6.5 to 6.8)."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from figures._errors import fluctuation
from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.thesis.chapter_6 import motion_blur
from figures.thesis.chapter_6.motion_blur import FULL, NETS, OTHERS, Keys

CROP_6_5 = (0.546875, 0.609375, 0.25)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without patterns."""


def thesis_6_5(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "Cornell box: rotated nets have less error than random points and the lattice\nthesis, Fig. 6.5; "
    paper = quality == "paper"
    whole = motion_blur.whole_images("cornell_box", (*NETS, *FULL)) if paper else {}
    waves = motion_blur.strongest_waves("cornell_box", whole)
    figure, numbers, images = motion_blur.pictures(
        "cornell_box", title, CROP_6_5, partial(_claims_6_5, waves), quality, progress, whole
    )
    numbers["measured"]["strongest wave, mean over keys"] = {
        size: {name: float(np.mean(values)) for name, values in of.items()} for size, of in waves.items()
    }
    return figure, numbers, images


def _claims_6_5(waves: Mapping[str, Mapping[str, Sequence[float]]], errors: Keys) -> Claims:
    one, other = NETS
    return {
        "the two rotated nets perform almost equally well (within 20 %)": {
            size: judged.alike(of[one], of[other], 1.2) for size, of in errors.items()
        },
        "they outperform random, jittered, Lloyd's points and the lattice": {
            size: judged.all_smaller(of, NETS, OTHERS) for size, of in errors.items()
        },
        "the full-screen nets perform worse than the rotated ones": {
            size: judged.all_smaller(of, NETS, FULL) for size, of in errors.items()
        },
        f"full-screen nets show patterns: waves {PATTERN:g} times those of rotated ones": {
            size: judged.all_of(
                *(judged.below(PATTERN * np.array(of[net]), of[full][0]) for net in NETS for full in FULL)
            )
            for size, of in waves.items()
        },
    }


FEW = 8
"""Samples per pixel up to which there are few."""

WHY_6_6 = (
    " On 256 x 256 pixels full-screen and rotated nets differ by at most 7 % at 2 to 64 samples, but "
    "full-screen nets have strongest waves of 43 to 110, rotated ones of 9 to 12."
)
"""Of the sentences that do not hold."""


def thesis_6_6(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log."""
    title = (
        "Cornell box: from 4 samples per pixel on, nets and lattices beat random samples\nthesis, Fig. 6.6"
    )
    figure, numbers = motion_blur.convergence("cornell_box", title, (16, 7), _claims_6_6, quality, progress)
    return figure, numbers | {"note": numbers["note"] + WHY_6_6}


def _claims_6_6(errors: dict, waves: dict) -> Claims:
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


CROP_6_7 = (0.5, 0.375, 0.25)


def thesis_6_7(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "Helicopter: full-screen Sobol' nets have the least error\nthesis, Fig. 6.7; "
    return motion_blur.pictures("helicopter", title, CROP_6_7, _claims_6_7, quality, progress)


def _claims_6_7(errors: Keys) -> Claims:
    def ahead(ones: tuple[str, ...], others: tuple[str, ...]) -> dict[str, Found]:
        """Return by size whether samplers have less error than others."""
        return {size: judged.all_smaller(of, ones, others) for size, of in errors.items()}

    return {
        "the Sobol' nets perform best": ahead(NETS + FULL, OTHERS),
        "the full-screen variants yield the best results": ahead(FULL, NETS),
        "the lattice has more error than any net": ahead(NETS + FULL, ("rank-1 lattice",)),
    }


WHY_6_8 = (
    " Up to 32 samples the lattice and the rotated nets are close; from 64 on the lattice has more "
    "error. The better of the full-screen nets varies with the count."
)
"""How narrowly sentences hold."""


def thesis_6_8(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log."""
    title = "Helicopter: from 4 samples per pixel on, nets beat random samples\nthesis, Fig. 6.8"
    figure, numbers = motion_blur.convergence("helicopter", title, (16, 7), _claims_6_8, quality, progress)
    return figure, numbers | {"note": numbers["note"] + WHY_6_8}


def _claims_6_8(errors: dict, waves: dict) -> Claims:
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
