"""The Z paper's comparison of four samplers on rendered scenes: images, and their errors seen from afar."""

from collections.abc import Callable

import analysis
from figures.shared import padded_samplers, scene_images, traced_images
from qmcjax import samplers, scenes, sequences

KEY = 5
SPP = 4
SIDE = {"draft": 128, "paper": 256}
REPLICATE = {"draft": 16, "paper": 64}

NAMES = ("(0,2)-sequence", "Sobol'", "ranked keys", "Z")


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
    """Return the four samplers for a square image of a scene with these coordinates."""
    sizes, bits = constituents(needs), spp.bit_length() - 1
    return {
        "(0,2)-sequence": padded_samplers.zero_two(sizes, key, key + 1, bits),
        "Sobol'": samplers.full_screen(sequences.sobol(len(needs)), side, side),
        "ranked keys": padded_samplers.ranked_in_orders(sizes, key, key + 1, bits),
        "Z": samplers.z(side, side, spp, key, constituents=sizes),
    }


def compare(
    name: str, crop: tuple[float, float, float], quality: str, progress: Callable[[float], None]
) -> tuple[list[traced_images.Panel], dict[str, dict[str, float]], traced_images.Reference]:
    """Render a scene with all samplers; return panels, measures by sampler, and the reference."""
    side, scene = SIDE[quality], getattr(scenes, name)()
    exact = traced_images.reference(name, side, REPLICATE[quality])
    panels, measured = [traced_images.Panel(f"{name}\nreference", exact.image, crop)], {}
    for done, (sampler, made) in enumerate(make_samplers(scene.needs, side).items(), start=1):
        image = scene_images.image(scene, made, side, SPP)
        measured[sampler] = {
            "RMS error": traced_images.rms_error(image, exact),
            "filtered error": analysis.filtered_error(image, exact.image),
            "low-frequency power": analysis.low_frequency_power(image, exact.image),
            "strongest wave": float(analysis.error_spectrum(image, exact.image).max()),
        }
        caption = f"{sampler}\nfiltered error {measured[sampler]['filtered error']:.4f}"
        panels.append(traced_images.Panel(caption, image, crop))
        progress(done / len(NAMES))
    return panels, measured, exact


def note(quality: str, exact: traced_images.Reference) -> str:
    """Return how images were made."""
    side = SIDE[quality]
    return (
        f"{side} x {side} pixels, {SPP} samples per pixel; scenes and cameras are ours. References are "
        f"{exact.origin}. Errors are over linear RGB; filtered errors are root mean squares after a Gaussian "
        "of 1.5 pixels, powers 1 for white noise, low those below 1/16 of a cycle per pixel. x and y, and "
        "each u and v, are pairs, others are single. (0,2): Sobol' points xored and shuffled in each pixel. "
        "Sobol': over the full screen, not scrambled. Ranked keys, after Heitz et al., are our own, another "
        "tile and order of the samples for each pair. Z: by hashing."
    )
