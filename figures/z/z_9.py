"""Z paper Fig. 9: a complex occluder and three coloured area lights, by four samplers."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._errors import rms
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import magnified, magnified_sheet
from figures.z import z_renderings
from figures.z.z_renderings import SPP, make_samplers
from qmcjax import scenes

CROP = (0.2, 0.6, 0.25)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without aliasing."""

WHITE = (0.6, 1.4)
"""Power at low frequencies that is near to that of white noise."""


SIDE = {"draft": 128, "paper": 256}
REPLICATE = {"draft": 16, "paper": 64}

KEYS = {"draft": 4, "paper": 16}
JUDGED_SIDE = {"draft": 32, "paper": 128}
"""Over how many keys claims are judged, on images of this side."""

NOTE = (
    f"{{side}} x {{side}} pixels, {SPP} samples per pixel; scenes and cameras are ours. Sentences are judged "
    "on {small} x {small} pixels over {keys} keys. References are {origin}. Errors are over linear RGB; "
    "filtered errors are root mean squares after a Gaussian of 1.5 pixels, powers 1 for white noise, low "
    "those below 1/16 of a cycle per pixel. x and y, and each u and v, are pairs, others are single. (0,2): "
    "Sobol' points xored and shuffled in each pixel. Sobol': over the full screen, not scrambled. Ranked "
    "keys, after Heitz et al., are our own, another tile and order of the samples for each pair. Z: by "
    "hashing. "
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the occluder, and measure errors and their spectra; hand the images out."""
    side, small, keys, scene = SIDE[quality], JUDGED_SIDE[quality], KEYS[quality], scenes.occluder()
    exact = diffusion.reference_of("occluder", side, REPLICATE[quality])
    images = {"reference": exact.image}
    panels = [magnified("occluder\nreference", exact.image, CROP)]
    measured: dict[str, dict[str, float]] = {}
    for name, sampler in make_samplers(scene.needs, side).items():
        image = images[name] = scene_images.image(scene, sampler, side, SPP)
        measured[name] = _measures(image, exact)
        caption = f"{name}\nfiltered error {measured[name]['filtered error']:.4f}"
        panels.append(magnified(caption, image, CROP))
    progress(0.2)
    over_keys = {}
    of_small = diffusion.reference_of("occluder", small, REPLICATE[quality])
    by_key = [make_samplers(scene.needs, small, key=key) for key in range(keys)]
    for name in measured:
        keyed = [made[name] for made in by_key[: 1 if name == "Sobol'" else keys]]
        found = [_measures(image, of_small) for image in scene_images.of_keys(scene, keyed, small, SPP)]
        over_keys[name] = {measure: [of[measure] for of in found] for measure in found[0]}
        progress(0.2 + 0.8 * len(over_keys) / len(measured))
    title = (
        f"A complex occluder and three coloured lights, {SPP} samples per pixel (Z paper, Fig. 9)\n"
        f"our scene, {side} x {side} pixels, one key; filtered error: RMS after a Gaussian of 1.5 pixels; "
        "ranked keys: ours, after Heitz et al."
    )
    note = NOTE.format(side=side, small=small, keys=keys, origin=exact.origin) + z_renderings.note()
    numbers = {
        "measured": measured
        | {
            "over keys": {
                name: {measure: judged.interval(values) for measure, values in of.items()}
                for name, of in over_keys.items()
                if name != "Sobol'"
            },
            "Sobol', image of the keys": {measure: of[0] for measure, of in over_keys["Sobol'"].items()},
            "filtered error, Z over (0,2)": judged.ratio(
                over_keys["Z"]["filtered error"], over_keys["(0,2)-sequence"]["filtered error"]
            ),
            "keys": keys,
            "reference_error": rms(exact.error),
        },
        "claims": _claims(over_keys),
        "note": note,
    }
    return magnified_sheet(title, panels, len(panels), 256, below=True), numbers, images


def _measures(image: NDArray, exact: diffusion.Reference) -> dict[str, float]:
    return {
        "RMS error": diffusion.rms_error(image, exact),
        "filtered error": analysis.filtered_error(image, exact.image),
        "low-frequency power": analysis.low_frequency_power(image, exact.image),
        "strongest wave": float(analysis.error_spectrum(image, exact.image).max()),
    }


def _claims(over_keys: dict[str, dict[str, list[float]]]) -> Claims:
    low = {name: np.array(of["low-frequency power"]) for name, of in over_keys.items()}
    waves = {name: np.array(of["strongest wave"]) for name, of in over_keys.items()}
    filtered = {name: of["filtered error"] for name, of in over_keys.items()}
    return {
        "Z has a blue-noise error: less than a third of white noise at low frequencies": judged.below(
            low["Z"], 1 / 3
        ),
        "Z has less error from afar than (0,2)": judged.smaller(filtered["Z"], filtered["(0,2)-sequence"]),
        "(0,2) diffuses nothing: low frequencies within 40 % of white noise": judged.all_of(
            judged.below(low["(0,2)-sequence"], WHITE[1]), judged.below(-low["(0,2)-sequence"], -WHITE[0])
        ),
        f"Sobol' has aliasing: its strongest wave {PATTERN:g} times that of (0,2)": judged.below(
            PATTERN * waves["(0,2)-sequence"], float(waves["Sobol'"][0])
        ),
    }
