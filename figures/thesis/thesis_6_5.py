"""Thesis Fig. 6.5: the Cornell box at 64 samples per pixel."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.shared.rendered import motion_blur
from figures.shared.rendered.motion_blur import FULL, NETS, OTHERS, Keys

CROP = (0.25, 0.6, 0.25)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without patterns."""


LATTICE = "rank-1 lattice"


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of Sect. 6.2."""
    title = "The Cornell box, 64 samples per pixel, and a magnified area (thesis Fig. 6.5)"
    errors, waves = motion_blur.over_keys("cornell_box", (*NETS, *FULL, LATTICE), quality)
    claims = partial(_claims, errors, waves)
    figure, numbers, images = motion_blur.pictures("cornell_box", title, CROP, claims, quality, progress)
    numbers["measured"] |= {
        "keys": motion_blur.KEYS[quality],
        "RMS error, mean over keys": _means(errors),
        "strongest wave, mean over keys": _means(waves),
    }
    return figure, numbers, images


def _means(keys: Keys) -> dict[str, dict[str, float]]:
    return {size: {name: float(np.mean(values)) for name, values in of.items()} for size, of in keys.items()}


def _claims(errors: Keys, waves: Keys, sets: motion_blur.Sets) -> Claims:
    one, other = NETS

    def ahead(size: str) -> Found:
        """Return whether both nets have less error than all others: but for the lattice by far."""
        far = judged.all_smaller(sets[size], NETS, [name for name in OTHERS if name != LATTICE])
        return judged.all_of(far, judged.all_smaller(errors[size], NETS, [LATTICE]))

    return {
        "the two rotated nets perform almost equally well (within 20 %)": {
            size: judged.alike(of[one], of[other], 1.2) for size, of in errors.items()
        },
        "they outperform random, jittered, Lloyd's points and the lattice": {
            size: ahead(size) for size in errors
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
