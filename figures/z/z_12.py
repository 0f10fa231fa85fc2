"""Z paper Fig. 12: variants of the Z-sampler and sizes of its alphabet, on the rods in coloured light."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures._errors import rms
from figures.making.schema import Claims, Found
from figures.shared import judged
from figures.shared.rendered import diffusion, padded_samplers, pixel_sets, scene_images
from figures.shared.sheets.image_sheets import Panel, add_axes, image_grid
from qmcjax import orders, samplers, scenes, sequences

INSET, SPP = 128, 2
"""Side of the images, and their samples per pixel."""
SIDE = {"draft": INSET, "paper": 64}
"""Of the image whose pixels the graphs are about: drafts have the same samplers for both."""
LOGS = {"draft": range(0, 7, 2), "paper": range(13)}
"""Binary logarithms of the numbers of samples of the graphs."""

PIXELS = {"draft": 16, "paper": 32}
"""Of each of the sets over which errors of the graphs are judged."""
KEYS = {"draft": 1, "paper": 16}
"""Among which the sets are divided."""

JUDGED_SIDE, JUDGED_KEYS, DIFFUSED = 32, 16, 6
"""Side and number of the images whose filtered errors paper quality judges, binary logarithm of their largest
number of samples."""

KEY = 1
ALPHABETS = {"1 letter": 1, "4 letters": 4, "16 letters": 16, "64 letters": 64, "256 letters": 256}

SAME = 1.1
"""Up to this factor errors are not noticeably different."""

LIKE_TREES = ("Z hash", "Z ART", "16 letters", "256 letters")
"""What is compared to Z with large tables, at two samples."""

FRESH, REUSED = "fresh permutations", "first quadrants like the image"

DIMENSIONS = (1, 2, 4)
"""Of the printed hash: the permutations of 1 and 4 are equal, up to an exchange of neighbours."""

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

SHOWN = ("Z0", "Z hash", "Z multiplicative", "Z", "Z ART", "1 letter", "16 letters", "Z joint", "(0,2)")
"""Whose images are shown, beside the reference."""

NOTE = (
    f"Images: {INSET} x {INSET} pixels, {SPP} samples per pixel. The paper does not describe its "
    "scene; we use the occluder of Fig. 9, five dimensions in three constituents: pixel, light and u, "
    "and v. 'Z hash' is our hash, which mixes three times per level, 'Z multiplicative' the paper's "
    "printed Z_hash; 'Z joint' has one sequence of five dimensions and one order. The reference is "
    f"{{origin}}. Graphs: {pixel_sets.SETS} sets of {{each}} random pixels of {{side}} x {{side}}, divided "
    "among {keys}, with intervals from the sets. Filtered errors: "
    f"{JUDGED_SIDE} x {JUDGED_SIDE} pixels, {JUDGED_KEYS} keys. Reuse: every node has its own permutation, "
    "or nodes whose numbers differ by leading zeros share one. Dimensions of the printed hash: RMS errors of "
    "products of two coordinates at the largest count, in the same sets of pixels. The dimensions of the "
    "graphs are random numbers, none of which repeat. " + diffusion.EXPLAINED
)


@cache
def _of_one_sample(name: str, dims: int, side: int, key: int) -> Any:
    """Return a Z-sampler for one sample: more have the same orders."""
    if name == "Z joint":
        return samplers.z(side, side, 1, key, sequence=sequences.sobol(dims))
    if name in ALPHABETS:
        return samplers.z(side, side, 1, key, "tree", dims, alphabet=ALPHABETS[name])
    variant = VARIANTS[name]
    return samplers.z(side, side, 1, None if variant == "plain" else key, variant, dims)


def _z(name: str, dims: int, side: int, spp: int, key: int) -> samplers.Sampler:
    if name in (FRESH, REUSED):
        made = _of_one_sample("Z ART", dims, side, key)
        # Letters are numbers of nodes: of all, level by level, or of their digits without leading zeros.
        letters = np.arange(4096)[:, None] * 4 + np.arange(4) + (name == FRESH)
        production = jnp.asarray(letters % 4096, jnp.uint16)
        return replace(made, spp=spp, orders=replace(made.orders, production=production))
    return replace(_of_one_sample(name, dims, side, key), spp=spp)


def ways(dims: int, side: int, spp: int, key: int = KEY) -> Mapping[str, samplers.Sampler]:
    """Return the implementations, the trees with few letters, and what they are compared to."""
    return {name: _z(name, dims, side, spp, key) for name in (*VARIANTS, *ALPHABETS, "Z joint")} | {
        "(0,2)": padded_samplers.zero_two(padded_samplers.pairs(dims), key, key),
        "random": samplers.contiguous(orders.raster(side, side), sequences.uniform(dims, key), spp),
    }


Errors = dict[str, dict[int, NDArray[np.float64]]]
"""By sampler and samples per pixel: of sets of pixels, or of keys."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render insets with all variants, and measure their errors over the number of samples."""
    side, scene, dims = SIDE[quality], scenes.occluder(), len(scenes.occluder().needs)
    exact = diffusion.reference(scene, side, SPP)
    reference = diffusion.reference(scene, INSET, SPP)
    samplers_of = ways(dims, INSET, SPP)
    insets = {name: scene_images.image(scene, samplers_of[name], INSET, SPP) for name in SHOWN}
    progress(0.1)
    counts = [2**k for k in LOGS[quality]]
    keys = range(KEY, KEY + KEYS[quality])
    of_keys = {spp: [ways(dims, side, spp, key) for key in keys] for spp in counts}
    errors = pixel_sets.compare(
        scene,
        exact,
        pixel_sets.draw_sets(side, PIXELS[quality]),
        {spp: {name: [made[name] for made in of] for name in of[0]} for spp, of in of_keys.items()},
        lambda part: progress(0.1 + 0.6 * part),
    )
    figure = _sheet(insets, counts, errors, reference)
    note = NOTE.format(
        side=side,
        origin=exact.origin,
        each=PIXELS[quality],
        keys=f"{len(keys)} key" + "s" * (len(keys) > 1),
    )
    last = counts[-1]
    measured: dict[str, Any] = {
        "largest count": last,
        "RMS error": {
            name: {f"{spp} spp": rms(values) for spp, values in of.items()} for name, of in errors.items()
        },
        "RMS error over that of Z, largest count": {
            name: judged.ratio(of[last], errors["Z"][last]) for name, of in errors.items() if name != "Z"
        },
        "RMS error of (0,2) over that of Z, all counts": judged.ratio(
            pixel_sets.over_counts(errors["(0,2)"]), pixel_sets.over_counts(errors["Z"])
        ),
    }
    if quality == "draft":
        return figure, {"measured": measured, "note": note}
    diffused = _filter_errors(scene)
    ours, printed = (_pair_errors(name, side, last, PIXELS[quality]) for name in ("hash", "multiplicative"))
    measured |= {
        "filtered error over that of Z, 2 spp": {
            name: judged.ratio(diffused[name][SPP], diffused["Z"][SPP]) for name in LIKE_TREES
        },
        "filtered error, padded over joint": {
            f"{spp} spp": judged.ratio(diffused["Z hash"][spp], diffused["Z joint"][spp])
            for spp in diffused["Z joint"]
        },
        "filtered error, reused over fresh permutations, 2 spp": judged.ratio(
            diffused[REUSED][SPP], diffused[FRESH][SPP]
        ),
        "RMS error of dimensions of the printed hash over our hash": {
            pair: judged.ratio(values, ours[pair]) for pair, values in printed.items()
        },
    }
    return figure, {"measured": measured, "claims": _claims(diffused, errors, printed), "note": note}


def _pair_errors(variant: str, side: int, spp: int, each: int) -> dict[str, NDArray[np.float64]]:
    """Return RMS errors of sets of pixels for products of coordinates of two constituents, by dimensions."""
    sampler: Any = samplers.z(side, side, spp, KEY, variant, constituents=(1,) * len(DIMENSIONS))
    if variant == "multiplicative":
        dims = jnp.asarray(DIMENSIONS, jnp.uint32)
        sampler = replace(sampler, orders=replace(sampler.orders, dim=dims))

    @jax.jit
    def means(x: Array, y: Array) -> Array:
        number = jnp.arange(spp, dtype=jnp.uint32)
        points = sampler(x[:, None], y[:, None], number, tuple(range(len(DIMENSIONS)))) - 0.5
        return jnp.einsum("psa,psb->pab", points, points) / spp

    pixels = pixel_sets.draw_sets(side, each)
    squares = np.square([means(x, y) for x, y in zip(pixels.x, pixels.y, strict=True)])
    of = np.sqrt(squares.mean(axis=1))
    pairs = combinations(range(len(DIMENSIONS)), 2)
    return {f"{DIMENSIONS[a]} and {DIMENSIONS[b]}": of[:, a, b] for a, b in pairs}


def _filter_errors(scene: Any) -> Errors:
    """Return filtered errors of images of many keys: of all variants at two samples, of two at all counts."""
    dims, found = len(scene.needs), {}
    exact = diffusion.reference(scene, JUDGED_SIDE, SPP)
    for spp in (2**k for k in range(DIFFUSED + 1)):
        names = ("Z hash", "Z joint", *(("Z", *LIKE_TREES, FRESH, REUSED) if spp == SPP else ()))
        for name in dict.fromkeys(names):
            keyed = [_z(name, dims, JUDGED_SIDE, spp, key) for key in range(JUDGED_KEYS)]
            images = scene_images.of_keys(scene, keyed, JUDGED_SIDE, spp)
            values = [diffusion.measures(image, exact)["filtered error"] for image in images]
            found.setdefault(name, {})[spp] = values
    return {name: {spp: np.array(values) for spp, values in of.items()} for name, of in found.items()}


def _sheet(
    insets: dict[str, NDArray], counts: list[int], errors: Errors, exact: diffusion.Reference
) -> Figure:
    """Lay insets out above the graphs of errors relative to large tables."""
    graphs = 840
    title = (
        "Hashing and large tables are alike, a single letter hinders convergence\n"
        f"Z paper, Fig. 12; our occluder at {SPP} samples per pixel; "
        "filtered: RMS error after a Gaussian of 1.5 pixels\n"
        "multiplicative: the paper's $Z_{hash}$; hash: ours, with more mixing; tree: 4096 letters"
    )
    panels = [Panel("reference", exact.image, transfer="srgb")]
    for name, image in insets.items():
        error = diffusion.measures(image, exact)["filtered error"]
        panels.append(Panel(f"{NAMES.get(name, name)}\nfiltered {error:.4f}", image, transfer="srgb"))
    figure = image_grid(title, panels, 5, below=graphs)
    of_graphs = {
        "implementations": [*VARIANTS, "Z joint", "(0,2)"],
        "sizes of the alphabet": ["Z0", *ALPHABETS, "Z"],
    }
    # Without their prefix they get colours of their own.
    short = {name: NAMES.get(name, name).removeprefix("Z, ") for name in errors}
    large = [rms(errors["Z"][spp]) for spp in counts]
    for k, (title, names) in enumerate(of_graphs.items()):
        curves = {short[name]: [rms(errors[name][spp]) for spp in counts] for name in names}
        plot.convergence(
            counts,
            {name: np.divide(values, large) for name, values in curves.items()},
            slopes=(),
            title=title,
            ylabel="RMS error relative to Z, tree",
            among=list(short.values()),
            ax=add_axes(figure, 150 + 1050 * k, 120, 510, graphs - 120 - 70),
        )
    return figure


def _claims(diffused: Errors, errors: Errors, printed: Mapping[str, NDArray[np.float64]]) -> Claims:
    last = max(errors["Z"])

    def like_trees(name: str) -> Found:
        return judged.alike(diffused[name][SPP], diffused["Z"][SPP], SAME)

    return {
        "no noticeable difference between hashing and look-up with large tables": like_trees("Z hash"),
        "nor between random and ART production": like_trees("Z ART"),
        "small tables, of 16 letters, work reasonably well": judged.smaller(
            diffused["16 letters"][SPP], diffused["Z"][SPP], SAME
        ),
        "256 letters work equally fine": like_trees("256 letters"),
        "convergence almost identical to that of (0,2)": judged.alike(
            pixel_sets.over_counts(errors["Z"]), pixel_sets.over_counts(errors["(0,2)"]), SAME
        ),
        "Z0 has fixed ordering for all dimensions: its errors are larger than with 1 letter": judged.smaller(
            errors["1 letter"][last], errors["Z0"][last]
        ),
        "padding has less error than a joint sequence of all dimensions, from afar": {
            f"{spp} spp": judged.smaller(diffused["Z hash"][spp], values)
            for spp, values in diffused["Z joint"].items()
        },
        "small tables hinder full convergence: 1 letter is worse than 4096 at the most samples": (
            judged.smaller(errors["Z"][last], errors["1 letter"][last], 1 / SAME)
        ),
        "the printed hash starts to slow down: more error than trees at the most samples": judged.smaller(
            errors["Z"][last], errors["Z multiplicative"][last], 1 / SAME
        ),
        "reuse of permutations at other depths does no harm": {
            REUSED: judged.smaller(diffused[REUSED][SPP], diffused[FRESH][SPP], SAME),
            "4096 letters at all depths": judged.smaller(errors["Z"][last], errors["Z hash"][last], SAME),
        },
        "repeated dimensions explain the slow-down: 1 and 4 have more error than 1 and 2": judged.smaller(
            printed["1 and 2"], printed["1 and 4"]
        ),
    }
