"""Z paper Fig. 10: motion blur, depth of field, paths, and paths from lights, by four samplers."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._errors import rms
from figures.making.schema import Claims
from figures.shared import diffusion, scene_images, traced_images
from figures.shared.z_renderings import NAMES, make_samplers
from qmcjax import scenes

SIDE = {"draft": 32, "paper": 128}
SHOWN = {"draft": 160, "paper": 256}
"""Pixels of the picture for an image."""
SPP = 16
KEYS = {"draft": 2, "paper": 8}
REFERENCE_SPP = {"draft": 512, "paper": 65536}
BOUNCES = {"draft": 2, "paper": 6}

ALMOST = 1.2
"""Up to this factor an error is almost the least."""

CROPS = {
    "sports": (0.3, 0.5, 0.25),
    "defocus": (0.4, 0.05, 0.25),
    "interior": (0.4, 0.55, 0.25),
    "caustic": (0.55, 0.6, 0.25),
}
"""Scenes with their magnified areas."""

NOTE = (
    "{side} x {side} pixels, {spp} samples per pixel; scenes are the package's: sports for motion blur, "
    "defocus for depth of field, the interior with {bounces} bounces for path tracing, the caustic for "
    "bidirectional path tracing. Errors are root mean squares over {keys} keys, but for Sobol', which has "
    "none. The ratio is that of the filtered to the whole error. "
    "Artifacts are read as an error from afar, which is the filtered one, of more than {almost:g} times that "
    "of Z, almost the best as one of less than {almost:g} times the least. (0,2): Sobol' points xored and "
    "shuffled in each pixel. Ranked keys, after Heitz et al., are our own, another tile and order "
    "of the samples for each pair of dimensions. Z: by hashing. What the paper shows in large images is "
    "more than these numbers, and 32 pixels a side tell little of it. Side by side, the four "
    "scenes make one image: sports and defocus above the interior and the caustic. {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render the four scenes by the four samplers, measure errors seen from afar, and hand the images out."""
    side, keys = SIDE[quality], KEYS[quality]
    compared = {name: getattr(scenes, name)() for name in CROPS}
    compared["interior"] = scenes.interior(BOUNCES[quality])
    panels, measured, origins = [], {}, ""
    handed_out: dict[str, list[NDArray]] = {}
    for done, (title, scene) in enumerate(compared.items(), start=1):
        area = diffusion.beside_window(side) if title == "interior" else diffusion.WHOLE
        exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
        origins += f"The reference of {title} is {exact.origin}. "
        panels.append(traced_images.Panel(f"{title}\nreference", exact.image, CROPS[title]))
        handed_out.setdefault("reference", []).append(exact.image)
        found = measured.setdefault(title, {})
        for name in NAMES:
            images = [
                scene_images.image(scene, make_samplers(scene.needs, side, SPP, key)[name], side, SPP)
                for key in range(1 if name == "Sobol'" else keys)
            ]
            found[name] = _together([diffusion.measures(image, exact, area) for image in images])
            caption = f"{name}\nfiltered error {found[name]['filtered error']:.4f}"
            panels.append(traced_images.Panel(caption, images[0], CROPS[title]))
            handed_out.setdefault(name, []).append(images[0])
        progress(done / len(compared))
    bounces = BOUNCES[quality]
    note = NOTE.format(side=side, spp=SPP, bounces=bounces, keys=keys, almost=ALMOST, origins=origins)
    title = f"Four scenes, {SPP} samples per pixel (Z paper Fig. 10)"
    figure = traced_images.sheet(panels, 1 + len(NAMES), title, SHOWN[quality])
    numbers = {
        "measured": measured,
        "claims": _claims(measured),
        "note": note + diffusion.BESIDE_WINDOW + diffusion.EXPLAINED,
    }
    return figure, numbers, {name: _side_by_side(images) for name, images in handed_out.items()}


def _side_by_side(images: list[NDArray]) -> NDArray[np.float64]:
    """Return one image of four."""
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)])


def _together(found: list[dict[str, float]]) -> dict[str, float]:
    """Return measures over keys: errors by their squares, the power by its mean."""
    errors = {name: rms([of[name] for of in found]) for name in ("RMS error", "filtered error")}
    low = float(np.mean([of["low-frequency power"] for of in found]))
    ratio = errors["filtered error"] / errors["RMS error"]
    return errors | {"ratio": ratio, "low-frequency power": low}


def _claims(measured: dict[str, dict[str, dict[str, float]]]) -> Claims:
    afar = {
        title: {name: of["filtered error"] for name, of in each.items()} for title, each in measured.items()
    }
    others = [name for name in NAMES if name != "Z"]
    return {
        "the others manifest artefacts in at least one scenario": {
            name: any(of[name] > ALMOST * of["Z"] for of in afar.values()) for name in others
        },
        "Z almost delivers the best quality": {
            title: of["Z"] < ALMOST * min(of.values()) for title, of in afar.items()
        },
        "ranked keys slightly outperform Z in the sports car": afar["sports"]["ranked keys"]
        < afar["sports"]["Z"],
        "ranked keys fail badly with bidirectional paths: a fifth more error than all others": afar[
            "caustic"
        ]["ranked keys"]
        > ALMOST * max(afar["caustic"][name] for name in NAMES if name != "ranked keys"),
    }
