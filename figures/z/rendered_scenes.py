"""Rendered scenes by four samplers: an occluder, motion blur, a lens, paths (Z paper, Fig. 9 and 10)."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._errors import rms
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import Panel, beside, cut, image_grid, mark, pixels_of, spectra
from figures.z import z_renderings
from figures.z.z_renderings import EFFECTS, SPP, make_samplers
from qmcjax import scenes

CROP = (0.2, 0.6, 0.28125)

PATTERN = 1.5
"""How much stronger the strongest wave is than that of an error without aliasing."""

WHITE = (0.6, 1.4)
"""Power at low frequencies that is near to that of white noise."""


SIDE_9 = {"draft": 128, "paper": 256}
REPLICATE = {"draft": 16, "paper": 64}

KEYS_9, JUDGED_SIDE_9 = 16, 128
"""Over how many keys paper quality judges claims, on images of this side."""

NOTE_9 = (
    f"{{side}} x {{side}} pixels, {SPP} samples per pixel; scenes and cameras are ours. {{judged}}References "
    "are {origin}. Errors are "
    "over linear RGB; filtered errors are RMS after a Gaussian of 1.5 pixels; power is 1 for white "
    "noise, low frequencies are below 1/16 cycle per pixel. x and y, and each u and v, form pairs. "
    "(0,2): Sobol' points xor-scrambled and shuffled per pixel. Sobol': over the full screen, not "
    "scrambled. Ranked keys, after Heitz et al., are ours, with a tile and a sample order per pair. Z: "
    "by hashing. "
)


def z_9(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the occluder, and measure errors and their spectra; hand the images out."""
    side, scene = SIDE_9[quality], scenes.occluder()
    exact = diffusion.reference_of("occluder", side, REPLICATE[quality])
    images = {"reference": exact.image}
    measured: dict[str, dict[str, float]] = {}
    for name, sampler in make_samplers(scene.needs, side).items():
        image = images[name] = scene_images.image(scene, sampler, side, SPP)
        measured[name] = _measures(image, exact)
    progress(0.2)
    title = (
        "Complex occluder: the error of Z is blue noise, that of Sobol' aliases\n"
        f"Z paper, Fig. 9; our scene, {side} x {side} pixels, {SPP} samples per pixel; "
        "ranked keys: ours, after Heitz et al.\n"
        "filtered: RMS error after a Gaussian of 1.5 pixels; spectra: frequency 0 in the middle, dark is less"
    )
    judged_on = f"Claims are judged on {JUDGED_SIDE_9} x {JUDGED_SIDE_9} pixels over {KEYS_9} keys. "
    numbers = {
        "measured": measured | {"reference_error": rms(exact.error)},
        "note": NOTE_9.format(side=side, judged=judged_on if quality == "paper" else "", origin=exact.origin)
        + z_renderings.note(),
    }
    if quality == "paper":
        over_keys = _over_keys_9(scene, list(measured), progress)
        numbers["claims"] = _claims_9(over_keys)
        numbers["measured"] |= {
            "over keys": {
                name: {measure: judged.interval(values) for measure, values in of.items()}
                for name, of in over_keys.items()
                if name != "Sobol'"
            },
            "Sobol', image of the keys": {measure: of[0] for measure, of in over_keys["Sobol'"].items()},
            "filtered error, Z over (0,2)": judged.ratio(
                over_keys["Z"]["filtered error"], over_keys["(0,2)-sequence"]["filtered error"]
            ),
            "keys": KEYS_9,
        }
    shown = {name: image for name, image in images.items() if name != "reference"}
    areas = [
        Panel(f"{name}\nfiltered {measured[name]['filtered error']:.4f}", cut(image, CROP), transfer="srgb")
        for name, image in shown.items()
    ]
    powers = spectra({name: analysis.error_spectrum(image, exact.image) for name, image in shown.items()}, {})
    of_errors = [Panel("spectrum of the error", image, powers.limits) for image in powers.images.values()]
    return beside(title, mark("reference", exact.image, CROP), [areas, of_errors]), numbers, images


def _over_keys_9(
    scene: Any, names: list[str], progress: Callable[[float], None]
) -> dict[str, dict[str, list[float]]]:
    """Return measures of images of each key, by sampler."""
    exact = diffusion.reference_of("occluder", JUDGED_SIDE_9, REPLICATE["paper"])
    by_key = [make_samplers(scene.needs, JUDGED_SIDE_9, key=key) for key in range(KEYS_9)]
    found = {}
    for done, name in enumerate(names, start=1):
        keyed = [made[name] for made in by_key[: 1 if name == "Sobol'" else KEYS_9]]
        of_keys = scene_images.of_keys(scene, keyed, JUDGED_SIDE_9, SPP)
        of = [_measures(image, exact) for image in of_keys]
        found[name] = {measure: [one[measure] for one in of] for measure in of[0]}
        progress(0.2 + 0.8 * done / len(names))
    return found


def _measures(image: NDArray, exact: diffusion.Reference) -> dict[str, float]:
    wave = float(analysis.error_spectrum(image, exact.image).max())
    return diffusion.measures(image, exact) | {"strongest wave": wave}


def _claims_9(over_keys: dict[str, dict[str, list[float]]]) -> Claims:
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


SIDE_10, JUDGED_SIDE_10, KEYS_10 = 128, 64, 16
"""Side of what is shown, and side and number of the images over which paper quality judges."""
SPP_10 = 16
REFERENCE_SPP = {"draft": 256, "paper": 65536}
BOUNCES = {"draft": 2, "paper": 6}

ALMOST = 1.2
"""Up to this factor an error is almost the least."""

CROPS = {
    "sports": (0.3, 0.35, 0.375),
    "defocus": (0.3, 0.0, 0.375),
    "interior": (0.4, 0.55, 0.375),
    "caustic": (0.5, 0.5, 0.375),
}
"""Scenes with their magnified areas."""

NOTE_10 = (
    f"{SIDE_10} x {SIDE_10} pixels, {SPP_10} samples per pixel; scenes are the package's: sports for "
    "motion blur, defocus for depth of field, the interior with {bounces} bounces for path tracing, "
    "the caustic for bidirectional path tracing. {judged} The ratio is that of filtered to unfiltered "
    f"errors. We read artefacts as more than {ALMOST:g} times the filtered error of Z, and almost the best "
    f"as less than {ALMOST:g} times the least. (0,2): Sobol' points "
    "xor-scrambled and shuffled per pixel. Ranked keys, after Heitz et al., are ours, with a tile and a "
    "sample order per pair of dimensions. Z: by hashing. The large images of the paper show more than "
    "these numbers. The exported image joins sports and defocus above the interior and the caustic. "
    "{origins}"
)

JUDGED = {
    "draft": "A draft judges no claims: it renders only what it shows, of one key.",
    "paper": f"Claims are judged on {JUDGED_SIDE_10} x {JUDGED_SIDE_10} pixels over {KEYS_10} keys; Sobol' "
    "has none. Errors are root mean squares over keys.",
}


def z_10(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render the four scenes by the four samplers, measure filtered errors, and hand the images out."""
    compared = {name: getattr(scenes, name)() for name in CROPS}
    compared["interior"] = scenes.interior(BOUNCES[quality])
    panels, over_keys, origins = [], {}, ""
    handed_out: dict[str, list[NDArray]] = {}
    for done, (title, scene) in enumerate(compared.items(), start=1):
        exact, area = _exact(title, scene, SIDE_10, quality)
        origins += f"The reference of {title} is {exact.origin}. "
        panels.append(mark(f"reference\n{EFFECTS[title]}", exact.image, CROPS[title]))
        part = pixels_of(CROPS[title], SIDE_10)
        if quality == "draft":
            exact, area = exact.part(*part), diffusion.WHOLE
        handed_out.setdefault("reference", []).append(exact.image)
        found = {}
        for name, made in make_samplers(scene.needs, SIDE_10, SPP_10, 0).items():
            if quality == "draft":
                image = shown = scene_images.of_area(scene, made, SIDE_10, SPP_10, *part)
            else:
                image = scene_images.image(scene, made, SIDE_10, SPP_10)
                shown = cut(image, CROPS[title])
            found[name] = [diffusion.measures(image, exact, area)]
            error = found[name][0]["filtered error"]
            panels.append(Panel(f"{name}\nfiltered error {error:.4f}", shown, transfer="srgb"))
            handed_out.setdefault(name, []).append(image)
        over_keys[title] = found if quality == "draft" else _of_keys(title, scene)
        progress(done / len(compared))
    note = NOTE_10.format(bounces=BOUNCES[quality], judged=JUDGED[quality], origins=origins)
    title = (
        "Filtered errors of Z are within a fifth of the least, except for motion blur\n"
        f"Z paper, Fig. 10; our scenes, {SIDE_10} x {SIDE_10} pixels, {SPP_10} samples per pixel; "
        "ranked keys: ours, after Heitz et al.\n"
        "filtered error: RMS after a Gaussian of 1.5 pixels, "
        + ("of the part that is shown" if quality == "draft" else "of the whole image that is shown in part")
    )
    figure = image_grid(title, panels, len(handed_out))
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
            "keys": len(afar["sports"]["Z"]),
        },
        "claims": _claims_10(afar),
        "note": note + z_renderings.note() + diffusion.BESIDE_WINDOW + diffusion.EXPLAINED,
    }
    rows = {name: [np.concatenate(of[k : k + 2], axis=1) for k in (0, 2)] for name, of in handed_out.items()}
    return figure, numbers, {name: np.concatenate(of) for name, of in rows.items()}


def _of_keys(title: str, scene: Any) -> dict[str, list[dict[str, float]]]:
    """Return measures of small images of each key by sampler."""
    exact, area = _exact(title, scene, JUDGED_SIDE_10, "paper")
    by_key = [make_samplers(scene.needs, JUDGED_SIDE_10, SPP_10, key) for key in range(KEYS_10)]
    found = {}
    for name in by_key[0]:
        keyed = [made[name] for made in by_key[: 1 if name == "Sobol'" else KEYS_10]]
        images = scene_images.of_keys(scene, keyed, JUDGED_SIDE_10, SPP_10)
        found[name] = [diffusion.measures(image, exact, area) for image in images]
    return found


def _exact(title: str, scene: Any, side: int, quality: str) -> tuple[diffusion.Reference, diffusion.Area]:
    """Return the reference of a scene, and the area in which errors are measured."""
    area = diffusion.beside_window(side) if title == "interior" else diffusion.WHOLE
    return diffusion.reference(scene, side, REFERENCE_SPP[quality]), area


def _together(found: list[dict[str, float]]) -> dict[str, float]:
    """Return measures over keys: errors by their squares, the power by its mean."""
    errors = {name: rms([of[name] for of in found]) for name in ("RMS error", "filtered error")}
    low = float(np.mean([of["low-frequency power"] for of in found]))
    ratio = errors["filtered error"] / errors["RMS error"]
    return errors | {"ratio": ratio, "low-frequency power": low}


def _claims_10(afar: dict[str, dict[str, list[float]]]) -> Claims:
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
        "ranked keys slightly outperform Z in the sports car": z_renderings.judge_by(
            lambda name: judged.smaller(afar["sports"][name], afar["sports"]["Z"])
        ),
        "ranked keys fail badly with bidirectional paths: a fifth more error than all others": (
            z_renderings.judge_by(
                lambda name: judged.all_smaller(afar["caustic"], others(name), [name], 1 / ALMOST)
            )
        ),
    }
