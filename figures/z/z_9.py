"""Z paper Fig. 9: a complex occluder and three coloured area lights, by four samplers."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import traced_images, z_renderings

CROP = (0.2, 0.6, 0.25)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without aliasing."""

WHITE = (0.6, 1.4)
"""Power at low frequencies that is near to that of white noise."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the occluder, and measure errors and their spectra; hand the images out."""
    panels, measured, over_keys, exact = z_renderings.compare("occluder", CROP, quality, progress)
    side = len(exact.image)
    title = (
        f"A complex occluder and three coloured lights, {z_renderings.SPP} samples per pixel (Z paper, "
        "Fig. 9)\n"
        f"our scene, {side} x {side} pixels, one key; filtered error: RMS after a Gaussian of 1.5 pixels; "
        "ranked keys: ours, after Heitz et al."
    )
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
            "keys": z_renderings.KEYS[quality],
            "reference_error": exact.error,
        },
        "claims": _claims(over_keys),
        "note": z_renderings.note(quality, exact),
    }
    images = dict(zip(("reference", *measured), (panel.image for panel in panels), strict=True))
    return traced_images.sheet(panels, len(panels), title, 256, below=True), numbers, images


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
