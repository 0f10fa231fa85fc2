"""Thesis Sect. 3.3.4: error and bias of predicted images, at as many samples as without prediction."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures._errors import rms
from figures._rc import BLACK, BLUE
from figures.plot import Style
from figures.shared.rendered import scene_images
from figures.shared.rendered.diffusion import shown
from figures.shared.sheets.image_sheets import Panel, axes_below, image_grid
from figures.shared.sheets.panels import curve, name_axes
from figures.thesis.chapter_3 import prediction
from figures.thesis.chapter_3.predicted_images import predict
from qmcjax import samplers, sequences


class Size(NamedTuple):
    """How much is measured."""

    side: int
    fails: tuple[int, ...]
    """Samples of pixels that are not predicted."""
    keys: int
    exact: int
    """Samples a pixel of the reference."""


SIZES = {"draft": Size(128, (4, 16), 2, 128), "paper": Size(128, (4, 12, 32), 8, 512)}
LEVELS = 3
CONTRAST = 0.1
_BATCH = 4
"""Samples of one program of plain images, of which there are as many as needed."""
REGIONS = {"box": "what moves", "shadow": "its shadow", "still": "nothing moves"}

NOTE = (
    "The scene is that of Fig. 3.3, {side} x {side} pixels, 9 intervals; reference: {exact} "
    "Owen-scrambled samples per pixel. Where n samples would be taken without prediction, n/4, n/8 and "
    "n/16 of them, at least one, check the levels; the contrast is {contrast}. Errors are RMS over "
    "pixels and {keys} keys, by all samples of a pixel in all intervals; without prediction there are "
    "as many random samples. Bias is the RMS error of means over keys, less their remaining noise. "
    "'What moves': pixels that see the box at some time; 'shadow': other pixels that change. The sphere "
    "is in neither. Bias falls little or not at all with more samples, as more predictions pass the "
    "check: the ratio of plain to predicted error is {fewest:.2f} at the fewest and {most:.2f} at the "
    "most samples."
)


Errors = dict[str, dict[str, dict[str, float]]]
"""By kind, samples of a pixel, and region."""

Regions = dict[str, NDArray[np.bool_]]
"""Which pixels are of what."""


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw errors over samples with and without prediction, and where the bias is."""
    size = SIZES[quality]
    side, count = size.side, 2**LEVELS + 1
    scene = prediction.sliding_box()
    exact = prediction.render_interval(side, size.exact, quality)
    progress(0.1)
    regions: Regions = {}
    errors: Errors = {"predicted": {}, "plain": {}}
    biases: dict[str, dict[str, float]] = {}
    mean = exact
    fraction: dict[str, float] = {}
    excess: dict[str, float] = {}
    # The most samples first: they show where something changes.
    for done, fail in enumerate(reversed(size.fails), start=1):
        checks = tuple(max(fail // 2 ** (level + 1), 1) for level in range(1, LEVELS + 1))
        found = [predict(scene, side, checks, fail, key, CONTRAST) for key in range(size.keys)]
        spent = float(np.mean([one.samples.mean() for one in found])) * count
        images = np.stack([one.image for one in found]).astype(np.float64)
        if not regions:
            regions = _regions(side, np.mean([one.images for one in found], axis=0))
            mean = images.mean(axis=0)
        spp = _BATCH * max(round(spent / _BATCH), 1)
        plain = np.stack([_plain(side, spp, key, quality) for key in range(size.keys)])
        at = f"{spp}"
        errors["predicted"][at] = _errors(images, exact, regions)
        errors["plain"][at] = _errors(plain, exact, regions)
        biases[at] = _biases(images, exact, regions)
        if done == 1:
            excess = _excess(images, exact, regions)
        fraction[at] = spent / (fail * count)
        progress(0.1 + 0.9 * done / len(size.fails))
    errors = {kind: dict(reversed(of.items())) for kind, of in errors.items()}
    biases, fraction = dict(reversed(biases.items())), dict(reversed(fraction.items()))
    measured: dict[str, Any] = {
        "pixels by region": {name: int(region.sum()) for name, region in regions.items()},
        "rms error by samples a pixel": errors,
        "bias by samples a pixel": biases,
        "squared error of the mean over that of noise, most samples": excess,
        "part of samples of no prediction": fraction,
        "error of plain over predicted, fewest samples": _ratio(errors, 0),
        "error of plain over predicted, most samples": _ratio(errors, -1),
    }
    ends = {part: _ratio(errors, place)["all"] for part, place in (("fewest", 0), ("most", -1))}
    claims = {
        "no longer unbiased: the mean over keys is farther off than noise explains": {
            name: excess[region] > 1.5 for region, name in REGIONS.items() if region != "still"
        },
        "moving shadows are not predicted: more bias there than in what moves": {
            f"{part} samples": list(biases.values())[place]["shadow"] > list(biases.values())[place]["box"]
            for part, place in (("fewest", 0), ("most", -1))
        },
        "much reduced variance: less error at as many samples": {
            f"{part} samples": ratio > 1 for part, ratio in ends.items()
        },
    }
    note = NOTE.format(side=side, exact=size.exact, contrast=CONTRAST, keys=size.keys, **ends)
    figure = _draw(size, exact, mean, errors, biases, regions)
    return figure, {"measured": measured, "claims": claims, "note": note}


def _plain(side: int, spp: int, key: int, quality: str) -> NDArray[np.float64]:
    """Return the image of the whole shutter by random samples."""
    scene = prediction.sliding_box()
    needs, total = len(scene.needs), 0.0
    for batch in range(spp // _BATCH):
        own = key * 1000 + batch
        sampler = samplers.independent(sequences.uniform(needs, own), own)
        total = total + scene_images.render_image(scene, sampler, side, _BATCH, quality)
    return np.asarray(total) / (spp // _BATCH)


def _regions(side: int, images: NDArray) -> Regions:
    """Return which pixels are of what, by the images of the intervals."""
    kinds = [prediction.first_hits(side, time).number.reshape(side, side) for time in np.linspace(0, 1, 17)]
    box = np.any([kind == prediction.BOX for kind in kinds], axis=0)
    mirror = kinds[0] == prediction.MIRROR
    changes = np.ptp(images, axis=0).max(axis=-1) > 0.1
    return {
        "all": np.ones_like(box),
        "box": box,
        "shadow": ~box & changes & ~mirror,
        "still": ~box & ~changes & ~mirror,
    }


def _errors(images: NDArray, exact: NDArray, regions: Regions) -> dict[str, float]:
    return {name: rms(images[:, region] - exact[region]) for name, region in regions.items()}


def _biases(images: NDArray, exact: NDArray, regions: Regions) -> dict[str, float]:
    """Return the RMS bias in each region: the error of means over keys without what is left of noise."""
    squares = (images.mean(axis=0) - exact) ** 2 - images.var(axis=0, ddof=1) / len(images)
    return {name: float(np.sqrt(max(squares[region].mean(), 0))) for name, region in regions.items()}


def _excess(images: NDArray, exact: NDArray, regions: Regions) -> dict[str, float]:
    """Return squared errors of means over keys over what their noise explains: 1 without a bias."""
    squares, noise = (images.mean(axis=0) - exact) ** 2, images.var(axis=0, ddof=1) / len(images)
    return {name: float(squares[region].mean() / noise[region].mean()) for name, region in regions.items()}


def _ratio(errors: Errors, place: int) -> dict[str, float]:
    predicted, plain = (list(errors[kind].values())[place] for kind in ("predicted", "plain"))
    return {region: plain[region] / predicted[region] for region in plain}


def _draw(
    size: Size,
    exact: NDArray,
    mean: NDArray,
    errors: Errors,
    biases: dict[str, dict[str, float]],
    regions: Regions,
) -> Figure:
    parts = sum(shade * regions[name] for name, shade in zip(REGIONS, (1.0, 0.5, 0.0), strict=True))
    panels = [
        Panel("reference", shown(exact)),
        Panel(
            f"mean error of {size.keys} predictions\n(black: -0.1, white: 0.1)",
            (mean - exact).mean(axis=-1),
            (-0.1, 0.1),
        ),
        Panel("white: what moves,\ngrey: its shadow", np.asarray(parts)),
    ]
    title = (
        "Predicted images have less error than plain ones, but are biased\n"
        f"thesis, Sect. 3.3.4; the scene of Fig. 3.3, {size.side} x {size.side} pixels, {size.keys} keys"
    )
    figure = image_grid(title, panels, 3, below=700)
    left, right = axes_below(figure, 700, 2)
    for kind, color in (("plain", BLACK), ("predicted", BLUE)):
        values = {n: of["all"] for n, of in errors[kind].items()}
        curve(left, values, Style(color, "o"), lw=1.5, label=f"error, {kind}")
    values = {n: of["all"] or np.nan for n, of in biases.items()}
    curve(left, values, Style(BLUE, "x", "--"), lw=1.5, label="bias, predicted")
    for k, (region, name) in enumerate(REGIONS.items()):
        values = {n: of[region] or np.nan for n, of in biases.items()}
        curve(right, values, Style(f"C{k}", "o"), lw=1.5, label=name)
    ticks = [int(n) for n in biases]
    for axes, what in ((left, "RMS of all pixels"), (right, "RMS bias by region")):
        name_axes(
            axes,
            "samples per pixel",
            what,
            log="xy",
            ticks=ticks,
            few_decades=True,
            legend="lower left",
            ncols=2,
        )
        low, high = axes.get_ylim()
        axes.set_ylim(low / 3, high)
    return figure
