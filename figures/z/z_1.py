"""Z paper Fig. 1: an interior at one sample per pixel by four samplers, and the spectra of their errors."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.making import heitz
from figures.making.schema import UNDECIDED, Claims, Found
from figures.shared import judged
from figures.shared.rendered import diffusion, padded_samplers, scene_images
from figures.shared.sheets import image_sheets
from figures.shared.sheets.curve_tables import SHARE, strongest_share
from figures.z import z_renderings
from qmcjax import samplers, scenes, sequences

SIDE = {"draft": 128, "paper": 256}
BOUNCES = {"draft": 2, "paper": 6}
REFERENCE_SPP = {"draft": 64, "paper": 8192}

KEY = 1
TILE = 64
"""Side of the tile that our ranked keys repeat."""

KEYS = 16
"""Over which the power of white noise is judged: that of one image has heavy tails."""

WHITE, BLUE = (0.67, 1.5), 0.67
"""Power at low frequencies: near to that of white noise, and below it."""

STRUCTURED = 1.1
"""How many times the share of white noise in the strongest frequencies shows structure."""

LOW, FILTERED = "low-frequency power", "filtered error"

REPEATS = "correlation of errors a tile apart"
SPIKES = "power at harmonics of the tile / mean"

FLAT, FADING = 128, (2, 4, 8, 16)
"""Side of an image that is the same in all pixels, and the numbers of coordinates of its integrands."""

NOTE = (
    f"{{side}} x {{side}} pixels, the package's interior with {{bounces}} bounces, {{dims}} dimensions: "
    "not the paper's scene. PBRT's (0,2)-sequence: pairs of dimensions, digitally shifted and shuffled "
    "per pixel. Ranked keys, after Heitz et al.: ours, optimised for pairs, each with its own "
    f"translation of a tile of 64 x 64 pixels, {{repeats}} of the image's width (theirs is 1/8 of it, "
    "for eight dimensions together). Spectra are those of the errors of the images above, the paper's of "
    f"images; low is {{low}}. The share is the power in "
    "the strongest 1 % of frequencies. With few tiles the spectrum has weak spikes; repetition would show "
    "as correlation of errors 64 pixels apart, but there the scene differs, and so do errors. A power at "
    f"low frequencies below {BLUE} of white noise is called blue. The reference is {{origin}}. "
)


Keys = dict[str, dict[str, list[float]]]
"""Values of each key by sampler and measure."""


def zero_two(dims: int, key: int) -> samplers.Sampler:
    """Return the sampler of the (0,2)-sequence, scrambled and shuffled in each pixel."""
    return padded_samplers.zero_two(padded_samplers.pairs(dims), key, key)


@cache
def _tree(dims: int, side: int, key: int) -> Any:
    """Return the Z-sampler for one sample: more have the same orders."""
    return samplers.z(side, side, 1, key, "tree", dims=dims)


def ways(dims: int, side: int, spp: int, key: int = KEY) -> dict[str, samplers.Sampler]:
    """Return the paper's samplers, by their names there."""
    return {
        "(0,2)": zero_two(dims, key),
        "Z": replace(_tree(dims, side, key), spp=spp),
        "ranked keys": padded_samplers.ranked(padded_samplers.pairs(dims), key),
        "Sobol'": samplers.full_screen(sequences.sobol(dims), side, side),
    }


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, NDArray]]:
    """Render with each sampler, show the spectra of the errors, and hand the images out."""
    side, scene = SIDE[quality], scenes.interior(BOUNCES[quality])
    area = diffusion.beside_window(side)
    exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
    progress(0.8)
    images, spectra, measured = {}, {}, {}
    handed_out = {"reference": exact.image[area]}  # without the window, as they are measured
    siblings: dict[str, float] = {}
    square = slice(side // 8, side - side // 8), slice(side // 4, side)
    shown = ways(len(scene.needs), side, 1) | z_renderings.beside(len(scene.needs), KEY)
    for name, sampler in shown.items():
        image = scene_images.image(scene, sampler, side, 1, KEYS)
        handed_out[name] = image[area]
        images[name] = diffusion.shown(image[square])
        spectra[name] = analysis.error_spectrum(image[square], exact.image[square])
        measured[name] = diffusion.measures(image, exact, area) | {SHARE: strongest_share(spectra[name])}
        tile = heitz.TILE if name == z_renderings.PUBLISHED else TILE
        if tile < side:
            measured[name][REPEATS] = _correlation((image - exact.image)[area], tile)
            measured[name][SPIKES] = _spikes((image - exact.image)[area], tile)
        if name == "Z":
            siblings = _neighbours((image - exact.image)[area])
    # Drafts measure only the images that they show.
    over_keys = _over_keys(scene, side, exact, area, square) if quality == "paper" else {}
    images["reference"] = diffusion.shown(exact.image[square])
    filtered = {name: f"filtered error {of['filtered error']:.3f}" for name, of in measured.items()}
    low = {
        name: f"low: {np.mean(over_keys[name][LOW]):.2f}, {KEYS} keys"
        if name in over_keys
        else f"low: {of[LOW]:.2f}"
        for name, of in measured.items()
    }
    rows = {
        "image": image_sheets.Row(images, captions=filtered),
        "error spectrum": image_sheets.spectra(spectra, low, (-1.0, 1.0)),
    }
    title = (
        "At one sample per pixel the error of Z is blue noise, that of the (0,2)-sequence white\n"
        f"Z paper, Fig. 1; part of our interior, {side} x {side} pixels, {BOUNCES[quality]} bounces\n"
        "filtered error: RMS after a Gaussian of 1.5 pixels; low: power below 1/16 cycle per pixel"
    )
    figure = image_sheets.image_sheet(title, rows)
    note = NOTE.format(
        side=side,
        bounces=BOUNCES[quality],
        dims=len(scene.needs),
        repeats=f"1/{side // TILE}",
        low=f"the mean over {KEYS} keys but for Sobol', which has none" if over_keys else "of one key",
        origin=exact.origin,
    )
    note += (
        z_renderings.note()
        + diffusion.BESIDE_WINDOW
        + "Spectra are of the middle square of it. "
        + diffusion.EXPLAINED
    )
    measured["correlation of Z's errors in neighbouring pixels"] = siblings
    if not over_keys:
        return figure, {"measured": measured, "note": note}, handed_out
    fading = _fading()
    numbers = {
        "measured": measured
        | {
            "filtered error of Z over (0,2) for a product of coordinates": {
                name: judged.ratio(ratios, np.ones(KEYS)) for name, ratios in fading.items()
            },
            "low-frequency power of (0,2), 16 keys": judged.interval(over_keys["(0,2)"][LOW]),
            "low-frequency power, 16 keys": {n: judged.interval(of[LOW]) for n, of in over_keys.items()},
            "share of the strongest, 16 keys": {n: judged.interval(of[SHARE]) for n, of in over_keys.items()},
        },
        "claims": _claims(measured, siblings, fading, over_keys),
        "note": note,
    }
    return figure, numbers, handed_out


def _over_keys(scene: Any, side: int, exact: diffusion.Reference, area: Any, square: Any) -> Keys:
    """Return measures of images of several keys, by the samplers that have a key."""
    dims = len(scene.needs)
    pairs = padded_samplers.pairs(dims)
    made: dict[str, Callable[[int], samplers.Sampler]] = {
        "(0,2)": lambda key: zero_two(dims, key),
        "Z": lambda key: samplers.z(side, side, 1, key, "tree", dims=dims),
        "ranked keys": lambda key: padded_samplers.ranked(pairs, key),
    } | {
        name: lambda key: z_renderings.beside(dims, key)[z_renderings.PUBLISHED]
        for name in z_renderings.beside(dims, KEY)
    }
    found: Keys = {}
    for name, of_key in made.items():
        of = found[name] = {LOW: [], FILTERED: [], SHARE: []}
        for key in range(KEYS):
            image = scene_images.image(scene, of_key(key), side, 1, KEYS)
            values = diffusion.measures(image, exact, area)
            values[SHARE] = strongest_share(analysis.error_spectrum(image[square], exact.image[square]))
            for measure, list_of in of.items():
                list_of.append(values[measure])
    return found


def _correlation(error: NDArray, tile: int) -> float:
    """Return that of errors at the same place of two tiles, one above the other."""
    upper, lower = error[:-tile], error[tile:]
    return float(np.sum(upper * lower) / np.sqrt(np.sum(upper**2) * np.sum(lower**2)))


def _spikes(error: NDArray, tile: int) -> float:
    """Return the power at harmonics of the tile over its mean, of as many whole tiles as there are."""
    rows, columns = (size // tile for size in error.shape[:2])
    tiles = error[: rows * tile, -columns * tile :]
    spectrum = analysis.error_spectrum(tiles, np.zeros_like(tiles))
    return float(spectrum[::rows, ::columns].mean() / spectrum.mean())


def _above(measured: dict[str, float], name: str, limit: float) -> Found:
    """Return whether what was measured is above a limit, undecided in images of one tile."""
    return measured[name] > limit if name in measured else UNDECIDED


def _neighbours(error: NDArray) -> dict[str, float]:
    """Return the correlation of errors of pixels that share an edge, within a block of 2 x 2 and across."""

    def correlation(pairs: list[tuple[NDArray, NDArray]]) -> float:
        return float(sum(np.sum(a * b) for a, b in pairs) / sum(np.sum(a**2 + b**2) / 2 for a, b in pairs))

    return {
        "siblings": correlation([(error[0::2], error[1::2]), (error[:, 0::2], error[:, 1::2])]),
        "cousins": correlation([(error[1:-1:2], error[2::2]), (error[:, 1:-1:2], error[:, 2::2])]),
    }


def _fading() -> dict[str, NDArray[np.float64]]:
    """Return filtered errors of Z over those of (0,2), of each key, for products of more coordinates."""
    row, column = np.divmod(np.arange(FLAT**2, dtype=np.uint32), np.uint32(FLAT))

    def filtered(keyed: Sequence[samplers.Sampler], dims: int) -> NDArray[np.float64]:
        found = scene_images.points(keyed, (column, row, 0 * row), dims)
        images = np.prod(2 * found, axis=-1, dtype=np.float64).reshape(-1, FLAT, FLAT)
        return np.array([analysis.filtered_error(image, np.ones_like(image)) for image in images])

    return {
        f"{dims} dimensions": filtered(
            [samplers.z(FLAT, FLAT, 1, key, "tree", dims=dims) for key in range(KEYS)], dims
        )
        / filtered([zero_two(dims, key) for key in range(KEYS)], dims)
        for dims in FADING
    }


def _claims(
    measured: dict[str, dict[str, float]],
    siblings: dict[str, float],
    fading: dict[str, NDArray[np.float64]],
    over_keys: Keys,
) -> Claims:
    white, share = over_keys["(0,2)"], measured["Sobol'"][SHARE]
    structured = STRUCTURED * np.array(white[SHARE])
    return {
        "the error of (0,2) is white noise": judged.all_of(
            judged.below(white[LOW], WHITE[1]), judged.below(-np.array(white[LOW]), -WHITE[0])
        ),
        "the error of Z is blue noise": judged.below(over_keys["Z"][LOW], BLUE),
        "the error of ranked keys is blue noise": z_renderings.judge_by(
            lambda name: judged.below(over_keys[name][LOW], BLUE)
        ),
        "Sobol' is structured: a larger share of the strongest frequencies than (0,2)": judged.below(
            structured, share
        ),
        "ranked keys repeat themselves at the period of the tile: a correlation above 0.1": (
            z_renderings.judge_by(lambda name: _above(measured[name], REPEATS, 0.1))
        ),
        "the spectrum of ranked keys has spikes at the tile's period: a tenth more than their share": (
            z_renderings.judge_by(lambda name: _above(measured[name], SPIKES, 1.1))
        ),
        "Z has no such structure": judged.smaller(over_keys["Z"][SHARE], structured),
        "Z has less filtered error than (0,2)": judged.smaller(over_keys["Z"][FILTERED], white[FILTERED]),
        "samples of siblings are better distributed than those of cousins: less correlated errors": (
            siblings["siblings"] < siblings["cousins"]
        ),
        "diffusion fades with the dimension: a larger ratio to (0,2), of 2 to 16": judged.all_of(
            *(judged.smaller(a, b) for a, b in pairwise(fading.values()))
        ),
        "in 16 dimensions the error is no worse than that of (0,2): at most 1.1 times it": judged.below(
            np.log(fading["16 dimensions"]), np.log(1.1)
        ),
    }
