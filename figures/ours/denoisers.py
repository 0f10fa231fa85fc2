"""What denoisers leave of the errors of samplers: of flat fields and traced scenes, and what they keep."""

import csv
import json
import sys
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plot
from figures._errors import rms
from figures.ours.denoised_errors import (
    AUXILIARY,
    BASE,
    COLUMNS,
    DEVIATIONS,
    PREDICTED,
    SIZES,
    Row,
    Shown,
    Size,
    correlate,
    divide_squares,
    logarithms,
    measure_flat,
    measure_noise,
    measure_scenes,
    summarize,
)
from figures.shared import judged
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax.bridges import oidn
from qmcjax.choosing import DENOISED, LEVELS, MEASURES
from qmcjax.core import tables

MARKS = ("x", "o", "s", "d")

NOTE = (
    "{side} x {side} pixels. Errors are relative to Owen-scrambled points in each pixel: geometric means "
    "with 95 % intervals over keys. Flat fields have the same integrand in all pixels, in each of {keys} "
    f"keys others of {COUNT} of two classes of {', '.join(CLASSES)}. Traced scenes have {{counts}} samples "
    "per pixel and {few} keys. Gaussian is the filtered error of 1.5 pixels, OIDN the RMS error after Open "
    f"Image Denoise (HDR, in JAX), auxiliary with albedo and normals of {AUXILIARY} samples per pixel. A "
    "measure without a network predicts the error of flat fields: the root of the power of the mean, of "
    "frequencies below 1/16 cycle per pixel, and of the concentration, which is the mean power of a "
    "frequency weighted by power: peaks and narrow bands count, broad noise hardly. Its rank correlation "
    "with the error after OIDN is over dimensions, samples and samplers. Shares are of the squared error "
    "after OIDN: of its mean, of blotches below 1/16 cycle per pixel, and of what was taken for a texture."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure, and draw what is left."""
    try:
        denoise = oidn.denoiser()
    except ImportError as error:
        return image_grid(str(error), [Panel("", np.ones((64, 64)))], 4), {"note": str(error)}
    size = SIZES[quality]
    flat, shown = measure_flat(size, denoise, lambda part: progress(part / 2))
    traced = measure_scenes(size, denoise, lambda part: progress(0.5 + part / 2))
    noise = measure_noise(size.side, denoise)
    cases = {f"{dims}-D, {spp} spp": (dims, spp) for dims, spp in product(size.dims, size.counts)}
    counts = ", ".join(map(str, size.counts_of_scenes))
    return _draw(size, flat, shown, traced, noise), {
        "measured": {
            "flat fields": {
                name: summarize([of for of in flat if (of.dims, of.spp) == case])
                for name, case in cases.items()
            },
            "traced scenes": summarize(traced),
            "shares of the squared error after OIDN": divide_squares(flat),
            "noise after OIDN / white noise": noise,
            "rank correlation": {of: correlate(flat, of) for of in ("raw", "Gaussian", PREDICTED)},
        },
        "table": [
            {
                **dict(zip(Row._fields[:-1], of, strict=False)),
                **{each: rms(of.numbers[each]) for each in COLUMNS},
            }
            for of in (*flat, *traced)
        ],
        "note": NOTE.format(side=size.side, keys=size.keys, counts=counts, few=size.keys_of_scenes),
    }


def _draw(
    size: Size, flat: list[Row], shown: Shown, traced: list[Row], noise: Mapping[str, Mapping[str, float]]
) -> Figure:
    """Draw errors of flat fields before and after, their means, those of scenes, and what is kept."""
    spp, panels = 16, []
    ends = [2.5 * rms(each) for each in shown[2, spp, BASE]]
    for name in (BASE, "Z, hash", "Hilbert, Owen-Sobol'"):
        raw, left = shown[2, spp, name]
        part = rms(left) / rms(shown[2, spp, BASE][1])
        panels.append(Panel(f"{name}\nerror", raw, (-ends[0], ends[0])))
        panels.append(Panel(f"\nafter OIDN, {part:.2f}", left, (-ends[1], ends[1])))
    figure = image_grid(
        "After a denoiser, regular errors can be the largest: it keeps them as a texture\n"
        f"above: a half-space in all pixels, {spp} samples per pixel, grey is no error; below: errors "
        "relative to Owen-scrambled points in each pixel",
        panels,
        6,
        below=1700,
    )
    for k, column in enumerate(COLUMNS[1:3]):
        axes = add_axes(figure, 170 + 700 * k, 1120, 480, 480)
        for name in size.samplers:
            errors = {
                count: float(np.exp(logarithms([of for of in flat if of.spp == count], name, column).mean()))
                for count in size.counts
            }
            curve(axes, errors, plot.style(name), label=name)
        look = {"log": "xy", "ticks": size.counts, "few_decades": True}
        name_axes(
            axes,
            "samples per pixel",
            "relative error",
            f"flat fields after {column.replace('Gauss', 'a Gauss')}",
            **look,
        )
        axes.set_yticks(ticks := _round_within(axes.get_ylim()), map(str, ticks))
    across, down = figure.get_size_inches() * DPI
    place = {"loc": "upper left", "bbox_to_anchor": (1390 / across, 1620 / down)}
    figure.legend(*figure.axes[-1].get_legend_handles_labels(), frameon=False, **place)
    _draw_scenes(add_axes(figure, 470, 150, 560, 640), summarize(traced))
    axes = add_axes(figure, 1330, 150, 600, 520)
    for (name, of), marker in zip(noise.items(), ".osD", strict=True):
        axes.plot(DEVIATIONS, list(of.values()), marker=marker, ms=4, lw=1, label=name)
    look = {"title": "noise after OIDN", "log": "xy", "few_decades": True, "ticks": DEVIATIONS}
    look |= {"legend": "lower center", "bbox_to_anchor": (0.5, 1.12)}
    name_axes(axes, "deviation of the noise / mean", "error / that of white noise", **look)
    return figure


def _draw_scenes(axes: Axes, summary: Mapping[str, Mapping[str, judged.Ratio]]) -> None:
    """Draw geometric means over scenes, and their intervals, by sampler."""
    for k, (column, marker) in enumerate(zip(COLUMNS, MARKS, strict=True)):
        middle, low, high = np.array([of[column] for of in summary.values()]).T
        look = {"fmt": marker, "ms": 4, "lw": 1, "label": column}
        y = np.arange(len(middle)) + 0.15 * (k - 1.5)
        axes.errorbar(middle, y, xerr=[middle - low, high - middle], **look)
    axes.axvline(1, color="0.4", lw=0.8)
    axes.set_yticks(range(len(summary)), list(summary))
    axes.invert_yaxis()
    look = {"legend": "lower center", "bbox_to_anchor": (0.4, 1.1), "ncols": 2}
    look |= {"ticks": _round_within(axes.get_xlim())}
    name_axes(axes, "relative error", title="traced scenes", log="x", **look)


def _round_within(limits: tuple[float, float]) -> list[float]:
    low, high = limits
    fine, coarse = (0.3, 0.4, 0.5, 0.6, 0.8, 1, 1.2, 1.5, 2, 3, 5), (0.1, 0.2, 0.5, 1, 2, 5, 10)
    return [each for each in (coarse if high > 6 * low else fine) if low < each < high]


def main() -> None:
    """Write the table behind ``qmcjax.recommend``, from the numbers of a folder with this figure."""
    numbers = json.loads((Path(sys.argv[1]) / "numbers.json").read_text(encoding="utf-8"))
    known = numbers["denoisers"]["numbers"]["table"]
    errors = {(of["scene"], of["sampler"], of["spp"]): [of[column] for column in COLUMNS[2:]] for of in known}
    size = "{} x {}".format(*DENOISED.sizes[0])
    with Path(str(tables.file("choosing", DENOISED.file))).open("w", encoding="utf-8", newline="") as stream:
        stream.write("# 1000 ln(error / error of random) after Open Image Denoise, without and with albedo\n")
        writer = csv.writer(stream, lineterminator="\n")
        counts = [f"{of} at {spp} spp" for of in MEASURES for spp in DENOISED.spps]
        writer.writerow(["scene", "kind", "level", "size", "sampler", *counts])
        for of in known:
            if of["sampler"] in DENOISED.candidates and of["spp"] == DENOISED.spps[0]:
                name, scene = of["sampler"], of["scene"]
                pairs = [
                    np.divide(errors[scene, name, spp], errors[scene, "random", spp]) for spp in DENOISED.spps
                ]
                level = next((level for level in LEVELS if of["dims"] <= level), max(LEVELS))
                kind = "edges" if of["edges"] else "smooth"
                row = [of["scene"], kind, level, size, of["sampler"]]
                writer.writerow([*row, *np.rint(1000 * np.log(pairs)).astype(int).T.ravel().tolist()])


if __name__ == "__main__":
    main()
