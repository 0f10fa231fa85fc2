"""Z paper Fig. 11: convergence of four samplers on the scenes of Fig. 1 and 10."""

from collections.abc import Callable, Collection

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures._errors import rms
from figures.making import heitz
from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.shared.rendered import diffusion, padded_samplers, pixel_sets
from figures.shared.sheets.panels import new_figure
from figures.z import z_renderings
from figures.z.z_1 import ways
from qmcjax import samplers, scenes

SIDE = {"draft": 32, "paper": 128}
PIXELS = {"draft": 16, "paper": 32}
"""Of each of the sets over which claims are judged."""
KEYS = {"draft": 1, "paper": 16}
"""Among which the sets are divided."""
LARGEST = {"draft": 3, "paper": 6}
"""Logarithm, to base 4, of the largest number of samples."""
REFERENCE_SPP = {"draft": 512, "paper": 65536}
BOUNCES = {"draft": 2, "paper": 6}

SAME = 1.15
"""Up to this factor errors are almost identical."""

NOTE = (
    f"{pixel_sets.SETS} sets of {{each}} random pixels of {{side}} x {{side}}, divided among {{keys}}; "
    "our scenes stand in for the paper's: sports for motion blur, defocus for depth of field, the "
    f"interior for path tracing, with {{bounces}} bounces, and the caustic for bidirectional path "
    "tracing. Intervals are of geometric means over the sets, as wide as the bands: a few pixels "
    "dominate the squared error. Samplers are those of Fig. 1; ranked keys, after Heitz et al., are "
    "ours, with a sample order per pair of dimensions: with one order for all, the error would level "
    "off like that of Z0 in Fig. 12. Theirs use 256 dimensions of one Owen-scrambled Sobol' sequence. "
    f"'Almost identical' is within a factor of {SAME}. {{origins}}"
)


Errors = dict[str, dict[str, dict[int, NDArray[np.float64]]]]
"""Of the sets of pixels, by scene, sampler and samples per pixel."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure RMS errors over the number of samples."""
    side, keys = SIDE[quality], range(1, KEYS[quality] + 1)
    counts = [4**k for k in range(LARGEST[quality] + 1)]
    compared = {
        "sports": scenes.sports(),
        "defocus": scenes.defocus(),
        "interior": scenes.interior(BOUNCES[quality]),
        "caustic": scenes.caustic(),
    }
    many = f"{len(keys)} key" + "s" * (len(keys) > 1)
    figure = new_figure(
        "Z and the (0,2)-sequence are alike in the interior; three scenes are too noisy to tell\n"
        f"Z paper, Fig. 11; our scenes, {side} x {side} pixels, {many}\n"
        "band: 95 % interval of Z; ranked keys: ours, after Heitz et al.",
        5.6,
    )
    errors: Errors = {}
    origins = ""
    for done, (axes, (title, scene)) in enumerate(
        zip(figure.subplots(2, 2).flat, compared.items(), strict=True)
    ):
        area = diffusion.beside_window(side) if title == "interior" else diffusion.WHOLE
        exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
        origins += f"The reference of {title} is {exact.origin}. "
        pixels = pixel_sets.draw_sets(side, PIXELS[quality], area)
        made = {spp: _ways(len(scene.needs), side, spp, keys) for spp in counts}
        found = errors[title] = pixel_sets.compare(
            scene, exact, pixels, made, lambda part, done=done: progress((done + part) / len(compared))
        )
        curves, band = _relative(found, counts)
        plot.convergence(
            counts,
            curves,
            bands={"Z": band},
            slopes=(),
            title=z_renderings.EFFECTS[title],
            ylabel="RMS error relative to (0,2)",
            ax=axes,
        )
    note = NOTE.format(side=side, each=PIXELS[quality], keys=many, bounces=BOUNCES[quality], origins=origins)
    last = counts[-1]
    at_last, over_counts = _at(errors, last), _over(errors, counts)
    measured = {
        title: {
            name: {f"{spp} spp": {"RMS error": rms(values)} for spp, values in of.items()}
            for name, of in found.items()
        }
        for title, found in errors.items()
    } | {
        "largest count": last,
        "Z over (0,2), all counts": judged.ratios(over_counts, "Z", "(0,2)"),
        "Z over (0,2), largest count": judged.ratios(at_last, "Z", "(0,2)"),
        "Sobol' over Z, largest count": judged.ratios(at_last, "Sobol'", "Z"),
        "ranked keys over Z, largest count": judged.ratios(at_last, "ranked keys", "Z"),
        "ranked keys over Sobol', all counts": judged.ratios(over_counts, "ranked keys", "Sobol'"),
    }
    return figure, {"measured": measured, "claims": _claims(errors), "note": note + z_renderings.note()}


def _relative(
    found: dict[str, dict[int, NDArray[np.float64]]], counts: list[int]
) -> tuple[dict[str, list[float]], NDArray[np.float64]]:
    """Return errors relative to those of (0,2), NaN where there are none, and the intervals of Z."""
    ratios = {
        name: {spp: judged.ratio(values, found["(0,2)"][spp]) for spp, values in of.items()}
        for name, of in found.items()
    }
    curves = {
        name: [of[spp]["mean"] if spp in of else np.nan for spp in counts] for name, of in ratios.items()
    }
    return curves, np.array([[ratios["Z"][spp][end] for spp in counts] for end in ("low", "high")])


def _ways(dims: int, side: int, spp: int, keys: range) -> dict[str, list[samplers.Sampler]]:
    """Return the samplers of Fig. 1 by key; each pair of dimensions has an order of the samples."""
    found: dict[str, list[samplers.Sampler]] = {}
    bits, pairs = (spp - 1).bit_length(), padded_samplers.pairs(dims)
    for key in keys:
        made = ways(dims, side, spp, key)
        made["ranked keys"] = padded_samplers.ranked_in_orders(pairs, key, key + 1, bits)
        if spp <= heitz.SEQUENCE:
            made |= z_renderings.beside(dims, key)
        for name, sampler in made.items():
            found.setdefault(name, []).append(sampler)
    return found | {"Sobol'": found["Sobol'"][:1]}


Sets = dict[str, dict[str, NDArray[np.float64]]]
"""By scene and sampler."""


def _at(errors: Errors, spp: int) -> Sets:
    """Return the errors at one count, of the samplers that have it."""
    return {
        title: {name: of[spp] for name, of in found.items() if spp in of} for title, found in errors.items()
    }


def _over(errors: Errors, counts: Collection[int]) -> Sets:
    """Return geometric means of errors over some counts, of the samplers that have all."""
    return {
        title: {
            name: pixel_sets.over_counts({spp: of[spp] for spp in counts})
            for name, of in found.items()
            if of.keys() >= set(counts)
        }
        for title, found in errors.items()
    }


def _claims(errors: Errors) -> Claims:
    counts = errors["sports"]["Z"].keys()

    def overtaken(name: str) -> dict[str, Found]:
        """Return by scene whether (0,2) and Z have more error at the sampler's largest count."""
        at = _at(errors, max(errors["sports"][name]))
        return {title: judged.all_smaller(of, [name], ["(0,2)", "Z"]) for title, of in at.items()}

    def leads(name: str) -> dict[str, Found]:
        """Return by scene whether a sampler has the least geometric mean of errors, over its counts."""
        over = _over(errors, errors["sports"][name].keys())
        return {title: judged.all_smaller(of, [name], ["(0,2)", "Z", "Sobol'"]) for title, of in over.items()}

    def alike(found: Sets) -> dict[str, Found]:
        return {title: judged.alike(of["Z"], of["(0,2)"], SAME) for title, of in found.items()}

    return {
        "Z almost identical to (0,2), over all counts": alike(_over(errors, counts)),
        "Z almost identical to (0,2), at the largest count": alike(_at(errors, max(counts))),
        "Sobol' eventually overtakes (0,2) and Z: it has by the largest count": overtaken("Sobol'"),
        "ranked keys eventually overtake (0,2) and Z: they have by the largest count": (
            z_renderings.judge_by(overtaken)
        ),
        "ranked keys tend to lead, surpassing Sobol': over the counts, it has the least product of errors": (
            z_renderings.judge_by(leads)
        ),
    }
