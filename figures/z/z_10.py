"""Z paper Fig. 10: motion blur, depth of field, paths, and paths from lights, by four samplers."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._errors import rms
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import magnified, magnified_sheet
from figures.z import z_renderings
from figures.z.z_renderings import EFFECTS, make_samplers
from qmcjax import scenes

SIDE = {"draft": 32, "paper": 128}
JUDGED_SIDE = {"draft": 32, "paper": 64}
"""Of images of all keys."""
SHOWN = 256
"""Pixels of the picture for an image."""
SPP = 16
KEYS = {"draft": 4, "paper": 16}
REFERENCE_SPP = {"draft": 256, "paper": 65536}
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
    f"{{side}} x {{side}} pixels, {SPP} samples per pixel; scenes are the package's: sports for motion blur, "
    "defocus for depth of field, the interior with {bounces} bounces for path tracing, the caustic for "
    "bidirectional path tracing. Sentences are judged on {small} x {small} pixels over {keys} keys; Sobol' "
    "has none. Errors are root mean squares over these; the ratio is of filtered to whole errors. Artifacts "
    f"are read as an error from afar, which is the filtered one, of more than {ALMOST:g} times that of Z, "
    f"almost the best as one of less than {ALMOST:g} times the least. (0,2): Sobol' points xored and "
    "shuffled in each pixel. Ranked keys, after Heitz et al., are our own, another tile and order of the "
    "samples for each pair of dimensions. Z: by hashing. What the paper shows in large images is more than "
    "these numbers. Side by side, the four scenes make one image: sports and defocus above the interior and "
    "the caustic. {origins}"
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render the four scenes by the four samplers, measure errors seen from afar, and hand the images out."""
    side, small, keys = SIDE[quality], JUDGED_SIDE[quality], KEYS[quality]
    compared = {name: getattr(scenes, name)() for name in CROPS}
    compared["interior"] = scenes.interior(BOUNCES[quality])
    panels, over_keys, origins = [], {}, ""
    handed_out: dict[str, list[NDArray]] = {}
    for done, (title, scene) in enumerate(compared.items(), start=1):
        exact, area = _exact(title, scene, side, quality)
        of_small, area_of_small = (exact, area) if small == side else _exact(title, scene, small, quality)
        origins += f"The reference of {title} is {exact.origin}. "
        panels.append(magnified(f"{EFFECTS[title]}\nreference", exact.image, CROPS[title]))
        handed_out.setdefault("reference", []).append(exact.image)
        found, images = over_keys.setdefault(title, {}), {}
        by_key = [make_samplers(scene.needs, small, SPP, key) for key in range(keys)]
        for name in by_key[0]:
            keyed = [made[name] for made in by_key[: 1 if name == "Sobol'" else keys]]
            images[name] = scene_images.of_keys(scene, keyed, small, SPP)
            found[name] = [diffusion.measures(image, of_small, area_of_small) for image in images[name]]
        for name, made in make_samplers(scene.needs, side, SPP, 0).items():
            image = images[name][0] if small == side else scene_images.image(scene, made, side, SPP)
            error = diffusion.measures(image, exact, area)["filtered error"]
            panels.append(magnified(f"{name}\nfiltered error {error:.4f}", image, CROPS[title]))
            handed_out.setdefault(name, []).append(image)
        progress(done / len(compared))
    bounces = BOUNCES[quality]
    note = NOTE.format(side=side, small=small, bounces=bounces, keys=keys, origins=origins)
    title = (
        f"Motion blur, a lens, paths and a caustic, {SPP} samples per pixel (Z paper, Fig. 10)\n"
        f"our scenes, {side} x {side} pixels; filtered error: RMS after a Gaussian of 1.5 pixels\n"
        "of the key that is shown; ranked keys: ours, after Heitz et al."
    )
    figure = magnified_sheet(title, panels, len(handed_out), SHOWN, below=True)
    afar = {
        title: {name: [of["filtered error"] for of in keys] for name, keys in found.items()}
        for title, found in over_keys.items()
    }
    numbers = {
        "measured": {
            title: {name: _together(keys) for name, keys in found.items()}
            for title, found in over_keys.items()
        }
        | {
            "filtered error over that of Z": {
                title: {name: judged.ratio(errors, of["Z"]) for name, errors in of.items() if name != "Z"}
                for title, of in afar.items()
            },
            "keys": keys,
        },
        "claims": _claims(afar),
        "note": note + z_renderings.note() + diffusion.BESIDE_WINDOW + diffusion.EXPLAINED,
    }
    return figure, numbers, {name: _side_by_side(images) for name, images in handed_out.items()}


def _exact(title: str, scene: Any, side: int, quality: str) -> tuple[diffusion.Reference, diffusion.Area]:
    """Return the reference of a scene, and the area in which errors are measured."""
    area = diffusion.beside_window(side) if title == "interior" else diffusion.WHOLE
    return diffusion.reference(scene, side, REFERENCE_SPP[quality]), area


def _side_by_side(images: list[NDArray]) -> NDArray[np.float64]:
    """Return one image of four."""
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)])


def _together(found: list[dict[str, float]]) -> dict[str, float]:
    """Return measures over keys: errors by their squares, the power by its mean."""
    errors = {name: rms([of[name] for of in found]) for name in ("RMS error", "filtered error")}
    low = float(np.mean([of["low-frequency power"] for of in found]))
    ratio = errors["filtered error"] / errors["RMS error"]
    return errors | {"ratio": ratio, "low-frequency power": low}


def _claims(afar: dict[str, dict[str, list[float]]]) -> Claims:
    def others(name: str) -> list[str]:
        """Return what a sampler is compared to: ranked keys not to those that they stand for."""
        same = z_renderings.names() if name in z_renderings.names() else (name,)
        return [other for other in afar["sports"] if other not in same]

    return {
        "the others manifest artefacts in at least one scenario": {
            name: judged.any_of(*(judged.smaller(of["Z"], of[name], 1 / ALMOST) for of in afar.values()))
            for name in others("Z")
        },
        "Z almost delivers the best quality": {
            title: judged.all_smaller(of, ["Z"], others("Z"), ALMOST) for title, of in afar.items()
        },
        "ranked keys slightly outperform Z in the sports car": z_renderings.judged_by(
            lambda name: judged.smaller(afar["sports"][name], afar["sports"]["Z"])
        ),
        "ranked keys fail badly with bidirectional paths: a fifth more error than all others": (
            z_renderings.judged_by(
                lambda name: judged.all_smaller(afar["caustic"], others(name), [name], 1 / ALMOST)
            )
        ),
    }
