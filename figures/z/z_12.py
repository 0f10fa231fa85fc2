"""Z paper Fig. 12: variants of the Z-sampler and sizes of its alphabet, on the rods in coloured light."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures.making.schema import Claims
from figures.shared import diffusion, padded_samplers, scene_images
from qmcjax import orders, samplers, scenes, sequences

SIDE = {"draft": 32, "paper": 64}
SPP = 2
"""Of the insets."""
LARGEST = {"draft": 6, "paper": 10}
"""Binary logarithm of the largest number of samples of the graphs."""
REFERENCE_SPP = {"draft": 1024, "paper": 65536}

KEY = 1
ALPHABETS = {"1 letter": 1, "4 letters": 4, "16 letters": 16, "64 letters": 64, "256 letters": 256}

SAME = 1.1
"""Up to this factor errors are not noticeably different."""

VARIANTS = {
    "Z0": "plain",
    "Z hash": "hash",
    "Z multiplicative": "multiplicative",
    "Z": "tree",
    "Z ART": "art",
}

NAMES = {
    "Z hash": "Z, hash",
    "Z multiplicative": "Z, multiplicative",
    "Z": "Z, tree",
    "Z ART": "Z, ART",
    "Z joint": "Z, joint",
} | {name: f"Z, {name}" for name in ALPHABETS}
"""In pictures."""

DPI = 150
INSET = 256
"""Pixels of the picture that an inset is wide, at most."""

NOTE = (
    "{side} x {side} pixels; insets have {spp} samples per pixel. The paper's scene is not given: here the "
    "occluder of Fig. 9, five dimensions, in which the three constituents are pixel, light and its u, and v. "
    "'Z hash' mixes the words of nodes three times a level, 'Z multiplicative' is the product that the "
    "paper prints; 'Z joint' has one sequence of five dimensions and one order. "
    "The reference is {origin}. Convergence stops at {most} samples: what differs beyond "
    "them, the drafts cannot tell. " + diffusion.EXPLAINED
)


@cache
def _orders(dims: int, side: int) -> dict[str, Any]:
    """Return the Z-samplers, for one sample: more have the same orders."""
    return (
        {
            name: samplers.z(side, side, 1, None if variant == "plain" else KEY, variant, dims)
            for name, variant in VARIANTS.items()
        }
        | {
            name: samplers.z(side, side, 1, KEY, "tree", dims, alphabet=letters)
            for name, letters in ALPHABETS.items()
        }
        | {"Z joint": samplers.z(side, side, 1, KEY, sequence=sequences.sobol(dims))}
    )


def ways(dims: int, side: int, spp: int) -> Mapping[str, samplers.Sampler]:
    """Return the implementations, the trees with few letters, and what they are compared to."""
    return {name: replace(made, spp=spp) for name, made in _orders(dims, side).items()} | {
        "(0,2)": padded_samplers.zero_two(padded_samplers.pairs(dims), KEY, KEY),
        "random": samplers.contiguous(orders.raster(side, side), sequences.uniform(dims, KEY), spp),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render insets with all variants, and measure their errors over the number of samples."""
    side, scene = SIDE[quality], scenes.occluder()
    exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
    progress(0.3)
    counts = [2**k for k in range(LARGEST[quality] + 1)]
    insets: dict[str, NDArray] = {}
    measured: dict[str, dict[str, dict[str, float]]] = {}
    compared = {spp: ways(len(scene.needs), side, spp) for spp in counts}
    images = scene_images.compared(scene, side, compared, lambda part: progress(0.3 + 0.7 * part))
    for (spp, name), image in images.items():
        measured.setdefault(name, {})[f"{spp} spp"] = diffusion.measures(image, exact)
        if spp == SPP:
            insets[name] = image
    figure = _sheet(insets | {"reference": exact.image}, counts, measured, SPP)
    note = NOTE.format(side=side, spp=SPP, origin=exact.origin, most=counts[-1])
    return figure, {"measured": measured, "claims": _claims(measured, counts), "note": note}


def _sheet(insets: dict[str, NDArray], counts: list[int], measured: dict, spp: int) -> Figure:
    """Lay insets out at whole zoom, seven a row, above the graphs."""
    top, gap, caption, graphs = 46, 12, 48, 640
    width, height = gap + 7 * (INSET + gap), top + 2 * (INSET + caption) + graphs
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    title = f"Variants of the Z-sampler and sizes of its alphabet, insets of {spp} spp (Z paper, Fig. 12)"
    figure.suptitle(title, y=1 - 14 / height, fontsize=10)
    for k, (name, image) in enumerate(insets.items()):
        row, column = divmod(k, 7)
        zoom = INSET // len(image)
        left, bottom = gap + column * (INSET + gap), height - top - (row + 1) * (INSET + caption)
        axes = plot.place(figure, image, left, bottom, zoom, transfer="srgb")
        text = NAMES.get(name, name)
        if name in measured:
            text += f"\nfiltered error {measured[name][f'{spp} spp']['filtered error']:.4f}"
        axes.set_title(text, fontsize=8, pad=3)
    for k, (title, names) in enumerate(
        {
            "implementations": [*VARIANTS, "Z joint", "(0,2)", "random"],
            "sizes of the alphabet; Z, tree has 4096 letters": ["Z0", *ALPHABETS, "Z", "random"],
        }.items()
    ):
        axes = figure.add_axes(
            ((110 + 940 * k) / width, 80 / height, 640 / width, (graphs - 80 - 70) / height)
        )
        plot.convergence(
            counts,
            {
                NAMES.get(name, name): [measured[name][f"{spp} spp"]["RMS error"] for spp in counts]
                for name in names
            },
            title=title,
            ax=axes,
        )
    return figure


def _claims(measured: dict, counts: list[int]) -> Claims:
    inset, last = "2 spp", f"{counts[-1]} spp"

    def near(one: str, other: str, spp: str, measure: str = "filtered error") -> bool:
        ratio = measured[one][spp][measure] / measured[other][spp][measure]
        return bool(1 / SAME < ratio < SAME)

    few = [measured[name][last]["RMS error"] for name in ALPHABETS]
    return {
        "no noticeable difference between hashing and look-up with large tables": near("Z", "Z hash", inset),
        "nor between random and ART production": near("Z", "Z ART", inset),
        "small tables, of 16 letters, work reasonably well": near("16 letters", "Z", inset),
        "256 letters work equally fine": near("256 letters", "Z", inset),
        "convergence almost identical to that of (0,2)": all(
            near("Z", "(0,2)", f"{spp} spp", "RMS error") for spp in counts
        ),
        "Z0 has fixed ordering for all dimensions: its errors are larger than with 1 letter": measured["Z0"][
            last
        ]["RMS error"]
        > few[0],
        "padding has less error than a joint sequence of all dimensions, from afar": {
            f"{spp} spp": measured["Z hash"][f"{spp} spp"]["filtered error"]
            < measured["Z joint"][f"{spp} spp"]["filtered error"]
            for spp in counts
        },
        "small tables hinder full convergence: 1 letter is worse than 4096 at the most samples": few[0]
        > SAME * measured["Z"][last]["RMS error"],
    }
