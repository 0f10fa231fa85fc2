"""What the page's playground renders with, samplers and scenes as shaders, and the images it begins with."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

import qmcjax as qj
from figures._errors import rms
from figures.playground import SCENES, START, make_sampler, ours
from figures.shared.sheets.image_sheets import Panel, image_grid

SIDE, KEY = 128, 1

NOTE = (
    f"{SIDE} x {SIDE} pixels, box filter, one key. In a browser with WebGL 2 the first page renders these, "
    "and the other samplers, scenes and counts, by the same code as shaders."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict, dict[str, bytes]]:
    """Translate all samplers and scenes, and draw what is shown first."""
    scene, spp = SCENES[START["scene"]](), START["spp"]
    exact = np.asarray(scene.reference(SIDE, SIDE)[0])
    panels, errors = [Panel("exact", exact)], {}
    for name in (START["left"], START["right"]):
        image = np.asarray(qj.render(scene, make_sampler(name, SIDE, spp, KEY), SIDE, SIDE, spp))
        errors[name] = rms(image - exact)
        panels.append(Panel(f"{name}\nRMS error {errors[name]:.3f}", image))
    progress(0.2)
    made = ours(SIDE)
    title = f"The page renders two samplers side by side\n{START['scene']}, {spp} spp"
    numbers = {"measured": {"RMS error": errors, "left out": made.left_out}, "note": NOTE}
    return image_grid(title, panels, 3), numbers, {}, {"data.js": made.script.encode()}
