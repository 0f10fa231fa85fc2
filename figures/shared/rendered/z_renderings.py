"""The Z paper's comparison of four samplers on rendered scenes: images, and their errors seen from afar."""

from collections.abc import Callable
from typing import NamedTuple

from numpy.typing import NDArray

import analysis
from figures.shared.rendered import padded_samplers, published_keys, scene_images, traced_images
from qmcjax import samplers, scenes, sequences

KEY = 5
SPP = 4
SIDE = {"draft": 128, "paper": 256}
REPLICATE = {"draft": 16, "paper": 64}

KEYS = {"draft": 4, "paper": 16}
JUDGED_SIDE = {"draft": 32, "paper": 128}
"""Over how many keys claims are judged, on images of this side."""

EFFECTS = {
    "sports": "motion blur",
    "defocus": "depth of field",
    "interior": "paths",
    "caustic": "bidirectional paths",
}
"""What the scenes of Fig. 10 and 11 are for."""


def constituents(needs: tuple[str, ...]) -> tuple[int, ...]:
    """Return the sizes of what belongs together: x and y, and all u and v; other coordinates are single."""
    sizes = []
    for name in needs:
        if name == "y" or name.endswith("_v"):
            sizes[-1] = 2
        else:
            sizes.append(1)
    return tuple(sizes)


def make_samplers(
    needs: tuple[str, ...], side: int, spp: int = SPP, key: int = KEY
) -> dict[str, samplers.Sampler]:
    """Return the samplers for a square image of a scene with these coordinates.

    They are the paper's four, with our ranked keys for those of Heitz et al., and these if they are there.
    """
    sizes, bits = constituents(needs), spp.bit_length() - 1
    made = {
        "(0,2)-sequence": padded_samplers.zero_two(sizes, key, key + 1, bits),
        "Sobol'": samplers.full_screen(sequences.sobol(len(needs)), side, side),
        "ranked keys": padded_samplers.ranked_in_orders(sizes, key, key + 1, bits),
        "Z": samplers.z(side, side, spp, key, constituents=sizes),
    }
    return made | published_keys.beside(len(needs), key)


Measures = dict[str, float]


class Comparison(NamedTuple):
    """What is shown of one key, and measures of several keys on smaller images."""

    panels: list[traced_images.Panel]
    measured: dict[str, Measures]
    over_keys: dict[str, dict[str, list[float]]]
    """Values of each measure by sampler; one value of those without a key."""
    exact: traced_images.Reference


def compare(
    name: str, crop: tuple[float, float, float], quality: str, progress: Callable[[float], None]
) -> Comparison:
    """Render a scene with all samplers and keys, and measure errors."""
    side, scene = SIDE[quality], getattr(scenes, name)()
    exact = traced_images.reference(name, side, REPLICATE[quality])
    panels, measured = [traced_images.Panel(f"{name}\nreference", exact.image, crop)], {}
    for sampler, made in make_samplers(scene.needs, side).items():
        image = scene_images.image(scene, made, side, SPP)
        measured[sampler] = _measures(image, exact)
        caption = f"{sampler}\nfiltered error {measured[sampler]['filtered error']:.4f}"
        panels.append(traced_images.Panel(caption, image, crop))
    progress(0.2)
    small, over_keys = JUDGED_SIDE[quality], {}
    of_small = traced_images.reference(name, small, REPLICATE[quality])
    by_key = [make_samplers(scene.needs, small, key=key) for key in range(KEYS[quality])]
    for sampler in measured:
        keyed = [made[sampler] for made in by_key[: 1 if sampler == "Sobol'" else len(by_key)]]
        found = [_measures(image, of_small) for image in scene_images.of_keys(scene, keyed, small, SPP)]
        over_keys[sampler] = {measure: [of[measure] for of in found] for measure in found[0]}
        progress(0.2 + 0.8 * len(over_keys) / len(measured))
    return Comparison(panels, measured, over_keys, exact)


def _measures(image: NDArray, exact: traced_images.Reference) -> Measures:
    return {
        "RMS error": traced_images.rms_error(image, exact),
        "filtered error": analysis.filtered_error(image, exact.image),
        "low-frequency power": analysis.low_frequency_power(image, exact.image),
        "strongest wave": float(analysis.error_spectrum(image, exact.image).max()),
    }


def note(quality: str, exact: traced_images.Reference) -> str:
    """Return how images were made."""
    side, small = SIDE[quality], JUDGED_SIDE[quality]
    return (
        f"{side} x {side} pixels, {SPP} samples per pixel; scenes and cameras are ours. Sentences are judged "
        f"on {small} x {small} pixels over {KEYS[quality]} keys. References are "
        f"{exact.origin}. Errors are over linear RGB; filtered errors are root mean squares after a Gaussian "
        "of 1.5 pixels, powers 1 for white noise, low those below 1/16 of a cycle per pixel. x and y, and "
        "each u and v, are pairs, others are single. (0,2): Sobol' points xored and shuffled in each pixel. "
        "Sobol': over the full screen, not scrambled. Ranked keys, after Heitz et al., are our own, another "
        "tile and order of the samples for each pair. Z: by hashing. " + published_keys.note()
    )
