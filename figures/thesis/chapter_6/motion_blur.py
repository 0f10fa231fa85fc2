"""The thesis's two moving scenes: the samplers of three dimensions it compares, images and convergence."""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure

import analysis
import qmcjax as qj
from figures import plot
from figures._errors import fluctuation, rms, slope
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.rendered import diffusion, pixel_sets, scene_images
from figures.shared.sheets.image_sheets import Crop, Panel, beside, cut, mark, pixels_of
from figures.shared.sheets.panels import new_figure
from qmcjax import orders, samplers, scenes, sequences

KEY = 7

MADE = {"Sobol' net": sequences.sobol_net_3d, "modified Sobol' net": sequences.larcher_pillichshammer_net_3d}
NETS = tuple(MADE)
FULL = tuple(f"{net}, full screen" for net in NETS)
OTHERS = ("random", "jittered grid", "Lloyd relaxation", "rank-1 lattice")
COMPARED = (*OTHERS, *NETS, *FULL)
"""The samplers of Sect. 6.2."""

SHOWN = ("random", "rank-1 lattice", NETS[0], FULL[0])
SHOWN_SIDE = {"draft": 128, "paper": 256}
"""What is shown in pictures, and their side."""

SIDES = (64, 128, 256)
"""Of the images on which sentences about pictures are judged, in paper quality."""
KEYS = 16
"""Of rotated points, there."""
REPLICATE = {"draft": 32, "paper": 128}
"""Samples in each replicate of an estimated reference."""


_lloyd = cache(sequences.lloyd)


def make_sampler(name: str, side: int, spp: int, key: int = KEY) -> samplers.Sampler:
    """Return a sampler for a square screen: of x, y and time."""
    m = spp.bit_length() - 1
    if name in ("random", "jittered grid"):
        points = sequences.uniform(3, key) if name == "random" else sequences.function(_jittered(spp, key), 3)
        return samplers.contiguous(orders.raster(side, side), points, spp)
    if name in FULL:
        net = MADE[NETS[FULL.index(name)]](2 * orders.log_side(side, side) + m)
        return samplers.full_screen(net, side, side)
    # Cranley-Patterson rotations of one set of points.
    make = {
        "Lloyd relaxation": lambda: _lloyd(spp, 3, key),
        "rank-1 lattice": lambda: sequences.components(sequences.rank1_lattice(spp, 3), (1, 2, 0)),
        **{net: partial(made, m) for net, made in MADE.items()},
    }
    return samplers.independent(make[name](), key, "shift")


def _jittered(spp: int, key: int) -> Callable[[Array], Array]:
    """Return random points of which each block of ``spp`` has one in each cell of a grid."""
    cells, uniform = round(spp ** (1 / 3)), sequences.uniform(3, key)

    def point(index: Array) -> Array:
        cell = jnp.stack([index // np.uint32(cells**j) % np.uint32(cells) for j in range(3)], axis=-1)
        # Sums may be rounded up to the next cell, but not to 1.
        return jnp.minimum((cell.astype(jnp.float32) + uniform(index)) / cells, np.float32(1 - 2**-24))

    return point


def counts(name: str, spps: list[int]) -> list[int]:
    """Return the numbers of samples that a sampler is made for: grids have cubes."""
    return [spp for spp in spps if name != "jittered grid" or round(spp ** (1 / 3)) ** 3 == spp]


Keys = dict[str, dict[str, np.ndarray]]
"""Errors of random sets of pixels, each with its key, by size of the image and sampler."""


Whole = dict[int, dict[str, list[np.ndarray]]]
"""Images of each key at 64 samples per pixel, by side and sampler."""


def pictures(
    name: str,
    title: str,
    crop: Crop,
    claims: Callable[[Keys], Claims],
    quality: str,
    progress,
    whole: Whole | None = None,
) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Show a scene, and an area of it and its errors with some samplers at 64 samples per pixel.

    ``claims`` takes the errors of all sizes, in paper quality; those of samplers in ``whole`` are of its
    images. Hands the images out.
    """
    scene, side, spp = getattr(scenes, name)(), SHOWN_SIDE[quality], 64
    exact = diffusion.reference_of(name, side, REPLICATE[quality])
    part = pixels_of(crop, side)
    drawn = exact if quality == "paper" else exact.part(*part)  # Drafts render only what they show.
    images = {
        each: scene_images.image(scene, made, side, spp)
        if quality == "paper"
        else scene_images.of_area(scene, made, side, spp, *part)
        for each in SHOWN
        for made in [make_sampler(each, side, spp)]
    }
    progress(0.3)
    areas = {each: cut(image, crop) if quality == "paper" else image for each, image in images.items()}
    differences = {each: area - cut(exact.image, crop) for each, area in areas.items()}
    scale = 3 * float(np.median([rms(each) for each in differences.values()]))
    panels = [Panel(each.replace(", ", ",\n"), area, transfer="srgb") for each, area in areas.items()]
    of_errors = [
        Panel(f"RMS error {diffusion.rms_error(images[each], drawn):.4f}", difference, (-scale, scale))
        for each, difference in differences.items()
    ]
    title += (
        f"our scene, {side} x {side} pixels, {spp} samples per pixel, one key\n"
        f"below: errors in the marked area, {-scale:.2g} is black, {scale:.2g} white; RMS of the "
        + ("whole image" if quality == "paper" else "area")
    )
    figure = beside(title, mark("reference", exact.image, crop), [panels, of_errors])
    numbers: dict[str, Any] = {
        "measured": {"reference_error": rms(exact.error)},
        "note": f"{side} x {side} pixels, {spp} samples per pixel, box filter; scene and camera are ours. "
        f"Claims are judged by intervals over {pixel_sets.SETS} random sets of the pixels, each with a key "
        f"of its own in paper quality, except for full-screen nets, which have none. " + _note(exact),
    }
    if quality == "paper":
        errors = over_keys(name, lambda part: progress(0.3 + 0.7 * part), whole or {})
        numbers["claims"] = claims(errors)
        numbers["measured"] |= {
            "keys": KEYS,
            "rms_error": {each: rms(of) for each, of in list(errors.values())[-1].items()},
            "RMS error, mean over keys": {
                size: {each: rms(values) for each, values in of.items()} for size, of in errors.items()
            },
            "over the screen / rotated": {
                size: {net: judged.ratio(of[full], of[net]) for net, full in zip(NETS, FULL, strict=True)}
                for size, of in errors.items()
            },
            "modified / Sobol' net": judged.ratios(errors, NETS[1], NETS[0]),
            "lattice / Sobol' net": judged.ratios(errors, "rank-1 lattice", NETS[0]),
        }
    return figure, numbers, {"reference": drawn.image} | images


def over_keys(name: str, progress: Callable[[float], None], whole: Whole) -> Keys:
    """Return errors of sets of pixels, divided among keys, at 64 samples per pixel by size and sampler."""
    spp, found = 64, {}
    for done, side in enumerate(SIDES):
        exact, pixels = diffusion.reference_of(name, side, REPLICATE["paper"]), pixel_sets.all_pixels(side)
        known = whole.get(side, {})
        by_count = pixel_sets.compare(
            getattr(scenes, name)(),
            exact,
            pixels,
            {spp: {each: _of_keys(each, side) for each in COMPARED if each not in known}},
            lambda part, done=done: progress((done + part) / len(SIDES)),
        )
        found[f"{side} x {side} pixels"] = {
            each: pixel_sets.errors_of_images(known[each], exact, pixels)
            if each in known
            else by_count[each][spp]
            for each in COMPARED
        }
    return found


def _of_keys(name: str, side: int) -> list[samplers.Sampler]:
    """Return samplers for 64 samples per pixel of all keys; full-screen nets have none."""
    return [make_sampler(name, side, 64, key) for key in range(1 if name in FULL else KEYS)]


def whole_images(name: str, names: tuple[str, ...]) -> Whole:
    """Return the images of some samplers of a scene."""
    scene = getattr(scenes, name)()

    def render(sampler: samplers.Sampler, side: int) -> np.ndarray:
        return np.asarray(qj.render(scene, sampler, side, side, 64), np.float64)

    return {
        side: {each: [render(made, side) for made in _of_keys(each, side)] for each in names}
        for side in SIDES
    }


def strongest_waves(name: str, whole: Whole) -> dict[str, dict[str, list[float]]]:
    """Return the strongest waves of errors of each image by size and sampler."""
    waves = {}
    for side, images in whole.items():
        exact = diffusion.reference_of(name, side, REPLICATE["paper"])
        waves[f"{side} x {side} pixels"] = {
            each: [_strongest_wave(image, exact) for image in of] for each, of in images.items()
        }
    return waves


def _note(exact: diffusion.Reference) -> str:
    return (
        f"The reference is {exact.origin}, RMS error {rms(exact.error):.1e}; its variance is taken off from "
        "mean square errors, which are over linear RGB. Lloyd's points, lattice and nets are rotated in each "
        "pixel unless they are over the full screen. The strongest wave of an error is the maximum of its "
        "power spectrum, whose mean is 1: white noise has 5 to 13. "
        "Time is the lattice's component i / n, the only one that has all values in all lattices; the third "
        "has but two at 8 samples, which leave the error of 2."
    )


def _strongest_wave(image: np.ndarray, exact: diffusion.Reference) -> float:
    return float(analysis.error_spectrum(image, exact.image).max())


def convergence(
    name: str,
    title: str,
    size: tuple[int, int],
    claims: Callable[[dict, dict], Claims],
    quality: str,
    progress,
) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, log-log; ``claims`` takes errors and strongest waves by count.

    ``size`` is the side of a draft's image, and the binary logarithm of its largest count.
    """
    side, largest = size if quality == "draft" else (128, 9)
    spps = [2**k for k in range(largest + 1)]
    scene, exact = getattr(scenes, name)(), diffusion.reference_of(name, side, REPLICATE[quality])
    progress(0.3)
    compared = {
        spp: {name: make_sampler(name, side, spp) for name in COMPARED if spp in counts(name, spps)}
        for spp in spps
    }
    images = scene_images.compare(scene, side, compared, lambda part: progress(0.3 + 0.7 * part))
    errors = {sampler: {} for sampler in COMPARED}
    waves = {sampler: {} for sampler in COMPARED}
    for (spp, sampler), image in images.items():
        errors[sampler][spp] = diffusion.rms_error(image, exact)
        waves[sampler][spp] = _strongest_wave(image, exact)

    least, floor = min(error for of in errors.values() for error in of.values()), rms(exact.error)
    figure = new_figure(f"{title}; {side} x {side} pixels, our scene, one key", 3.8)
    plot.convergence(
        spps,
        {sampler: [of.get(spp, np.nan) for spp in spps] for sampler, of in errors.items()},
        floor=floor if floor > least / 10 else None,  # Or it would take half of the axis.
        ax=figure.subplots(),
    )
    numbers = {
        "measured": {
            "rms_error": _by_name(errors),
            "strongest wave": _by_name(waves),
            "slope": {sampler: slope(of) for sampler, of in errors.items()},
            "fluctuation": {sampler: fluctuation(of) for sampler, of in errors.items()},
            "reference_error": rms(exact.error),
        },
        "claims": claims(errors, waves),
        "note": f"{side} x {side} pixels; 'claims' lists the thesis's sentences and whether they hold in "
        "these numbers. 'fluctuation' is the root mean square of the distances of the errors' logarithms "
        f"from the line that fits them best. {_note(exact)}",
    }
    return figure, numbers


def _by_name(table: dict[str, dict[int, float]]) -> dict[str, dict[str, float]]:
    return {sampler: {f"{spp} spp": value for spp, value in of.items()} for sampler, of in table.items()}


def ratio(errors: dict, one: str, other: str) -> float:
    """Return the geometric mean of one sampler's errors over another's, from 2 samples on."""
    common = [spp for spp in errors[one] if spp in errors[other] and spp > 1]
    return float(np.exp(np.mean([np.log(errors[one][spp] / errors[other][spp]) for spp in common])))


def smaller(errors: dict, ones: tuple[str, ...], others: tuple[str, ...], factor: float = 1.0) -> bool | str:
    """Return whether samplers have less error than ``factor`` times others, over counts from 2 on."""
    pairs = [
        (errors[one][spp], errors[other][spp])
        for one, other in zip(ones, others, strict=True)
        for spp in errors[one]
        if spp in errors[other] and spp > 1
    ]
    return judged.smaller([one for one, _ in pairs], [other for _, other in pairs], factor)


def slightly_smaller(errors: dict, one: str, other: str) -> bool | str:
    """Return whether a sampler has less error than another, by less than 10 %."""
    return judged.all_of(smaller(errors, (one,), (other,)), smaller(errors, (other,), (one,), 1 / 0.9))


def claims_of_both(errors: dict) -> Claims:
    """Return what the thesis says of the convergence on both scenes.

    Wins count from 4 samples on: with fewer, nets and lattices are the same points.
    """
    wins = [
        max(errors[net][spp] for net in NETS)
        < min(errors[other][spp] for other in OTHERS if spp in errors[other])
        for spp in errors[NETS[0]]
        if spp >= 4
    ]
    over_rotated = {
        net: [errors[full][spp] / errors[net][spp] for spp in errors[full]]
        for full, net in zip(FULL, NETS, strict=True)
    }
    return {
        "the rotated nets outperform the others for almost all counts (all but one)": (
            sum(wins) >= len(wins) - 1
        ),
        "the full-screen nets converge faster: a steeper slope": {
            net: judged.falls(list(errors[net]), ratios) for net, ratios in over_rotated.items()
        },
        "nets and lattices are superior to random samples": {
            name: ratio(errors, name, "random") < 1 for name in (*NETS, *FULL, "rank-1 lattice")
        },
    }
