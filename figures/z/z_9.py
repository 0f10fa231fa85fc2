"""Z paper Fig. 9: a complex occluder and three coloured area lights, by four samplers."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.shared import traced_images, z_renderings

CROP = (0.2, 0.6, 0.25)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without aliasing."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the occluder, and measure errors and their spectra; hand the images out."""
    panels, measured, exact = z_renderings.compare("occluder", CROP, quality, progress)
    title = f"The occluder, {z_renderings.SPP} samples per pixel (Z paper Fig. 9)"
    low = {name: of["low-frequency power"] for name, of in measured.items()}
    waves = {name: of["strongest wave"] for name, of in measured.items()}
    filtered = {name: of["filtered error"] for name, of in measured.items()}
    claims = {
        "Z has a blue-noise error: less than a third of white noise at low frequencies": low["Z"] < 1 / 3,
        "Z has less error from afar than (0,2)": filtered["Z"] < filtered["(0,2)-sequence"],
        "(0,2) diffuses nothing: low frequencies within 40 % of white noise": abs(low["(0,2)-sequence"] - 1)
        < 0.4,
        f"Sobol' has aliasing: its strongest wave {PATTERN:g} times that of (0,2)": waves["Sobol'"]
        > PATTERN * waves["(0,2)-sequence"],
    }
    numbers = {
        "measured": measured | {"reference_error": exact.error},
        "claims": claims,
        "note": z_renderings.note(quality, exact),
    }
    names = ("reference", *z_renderings.NAMES)
    images = {name: panel.image for name, panel in zip(names, panels, strict=True)}
    return traced_images.sheet(panels, 3, title, 256), numbers, images
