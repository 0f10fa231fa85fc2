"""What denoisers leave of the errors of samplers: of flat fields and traced scenes, and what they keep."""

import csv
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import rankdata

import analysis
from figures import plot
from figures._errors import rms
from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.rendered import diffusion, scene_images
from figures.shared.sheets.image_sheets import DPI, Panel, add_axes, image_grid
from figures.shared.sheets.panels import curve, name_axes
from qmcjax import scenes, tracing
from qmcjax.bridges import oidn
from qmcjax.choosing import CANDIDATES, DENOISED, LEVELS, MEASURES
from qmcjax.core import tables
from qmcjax.core.pytrees import frozen_pytree

BASE = "(0,2), Owen"
SAMPLERS = (
    *(BASE, "random", "rank-1 lattice", "dither mask", "ranked keys", "designed tiles", "Z, hash"),
    *("optimised orders", "Hilbert, Owen-Sobol'", "Hilbert, Halton (2,3)"),
)
FEW = (BASE, "designed tiles", "Z, hash", "Hilbert, Owen-Sobol'")
IN_SCENES = tuple(DENOISED.candidates)

SCENES: dict[str, Callable[[], scenes.Traced]] = {
    "Cornell box": scenes.cornell_box,
    "moving triangles": scenes.moving_triangles,
    "occluder": scenes.occluder,
    "defocus": scenes.defocus,
    "helicopter": scenes.helicopter,
    "interior": lambda: scenes.interior(2),
    "sports": scenes.sports,
    "caustic": scenes.caustic,
}
REFERENCE = 2**14
"""Samples per pixel of references that are estimated."""

AUXILIARY = 64
"""Samples per pixel of albedo and normals."""


class Size(NamedTuple):
    """How much is measured."""

    samplers: tuple[str, ...]
    dims: tuple[int, ...]
    counts: tuple[int, ...]
    keys: int
    scenes: tuple[str, ...]
    in_scenes: tuple[str, ...]
    counts_of_scenes: tuple[int, ...]
    side: int
    keys_of_scenes: int


SIZES = {
    "draft": Size(FEW, (2,), (1, 16), 8, ("Cornell box",), FEW[::3], (4,), 64, 4),
    "paper": Size(SAMPLERS, (2, 4), (1, 2, 4, 8, 16, 64), 16, tuple(SCENES), IN_SCENES, (1, 4, 16), 128, 4),
}

COLUMNS = ("raw", "Gaussian", "OIDN", "OIDN, auxiliary")
MARKS = ("x", "o", "s", "d")

LOW = 1 / 16
"""Cycles per pixel, below which errors are blotches."""

DEVIATIONS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Of noise, relative to its mean."""

SHARES = ("mean", "blotches", "texture")
PREDICTED = "predicted"

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


@frozen_pytree
class Flat:
    """All integrands of a number of dimensions, the same in every pixel."""

    dims: int = field(metadata={"static": True})
    side: int = field(metadata={"static": True})

    @property
    def needs(self) -> tuple[str, ...]:
        """Return the names of the coordinates."""
        return tuple(map(str, range(self.dims)))

    def __call__(self, point: Array) -> Array:
        """Return all values at points."""
        within = jnp.concatenate([point[..., :2] * self.side % 1, point[..., 2:]], -1)
        return integrands_of_dims.values(within[None])[0]


@frozen_pytree
class Features:
    """Albedo and normals of what a camera sees: six values."""

    scene: scenes.Traced

    @property
    def needs(self) -> tuple[str, ...]:
        """Return the names of the coordinates."""
        return self.scene.needs

    def __call__(self, point: Array) -> Array:
        """Return all values at points."""
        of = self.scene.estimator
        painted = [replace(each, material=_paint(each.material)) for each in of.world.objects]
        albedo = tracing.direct_light(tracing.world(painted), of.camera)
        at = dict(zip(self.needs, jnp.moveaxis(point, -1, 0), strict=True))
        time = of.camera.times(at.get("time", jnp.zeros_like(at["x"])))
        sight = of.camera.rays(at["x"], at["y"], time, tuple(at[name] for name in of.camera.lens))
        origin, direction = (jnp.stack(vector, -1) for vector in (sight.origin, sight.direction))
        hit = tracing.nearest_hit(of.world, origin, direction, time)
        seen = albedo(jnp.stack([at[name] for name in albedo.needs], -1))
        return jnp.concatenate([seen, hit.normal], -1)


def _paint(material: Any) -> Any:
    """Return a material that emits the albedo of another; that of lamps is 1."""
    diffuse = getattr(material, "diffuse", None)
    color = getattr(material, "color", 1.0) if diffuse is None else diffuse
    return tracing.emitter(color)


def split(error: NDArray) -> dict[str, float]:
    """Return the parts of the mean square of an error, and what predicts the error after a denoiser."""
    power = np.square(np.abs(np.fft.fft2(error))) / error.size**2
    mean, power[0, 0] = float(power[0, 0]), 0
    blotches, whole = float(power[_frequency(len(error)) < LOW].sum()), float(power.sum())
    concentration = float(np.square(power).sum()) / whole
    parts = (mean, blotches, whole - blotches)
    return dict(zip(SHARES, parts, strict=True)) | {PREDICTED: (mean + blotches + concentration) ** 0.5}


def _frequency(side: int) -> NDArray[np.float64]:
    return np.hypot(*np.meshgrid(*[np.fft.fftfreq(side)] * 2))


class Row(NamedTuple):
    """Numbers of a sampler in a scene, by name and key."""

    scene: str
    edges: bool
    dims: int
    spp: int
    sampler: str
    numbers: Mapping[str, Sequence[float]]


def _by_name(of_keys: Sequence[Mapping[str, float]]) -> dict[str, list[float]]:
    return {name: [of[name] for of in of_keys] for name in of_keys[0]}


Shown = dict[tuple[int, int, str], tuple[NDArray, NDArray]]
"""Errors of a flat field, raw and denoised, by dimensions, samples per pixel and sampler."""


def measure_flat(size: Size, denoise: Any, progress: Callable[[float], None]) -> tuple[list[Row], Shown]:
    """Measure flat fields: even keys have half-spaces and bumps, odd ones balls and products."""
    rows: list[Row] = []
    shown: Shown = {}
    cases = list(product(size.dims, size.counts, size.samplers))
    for done, (dims, spp, name) in enumerate(cases, start=1):
        make, (mean, deviation) = CANDIDATES[name].make, integrands_of_dims.moments(dims)
        keyed = [make(dims, size.side, size.side, spp, key) for key in range(1, size.keys + 1)]
        images = scene_images.of_keys(Flat(dims, size.side), keyed, size.side, spp)
        for k, of in enumerate(CLASSES):
            numbers = []
            for key in range(k % 2, size.keys, 2):
                pick = COUNT * k + key // 2 % COUNT
                image = images[key][..., pick]
                raw, left = ((each - mean[pick]) / deviation[pick] for each in (image, _grey(denoise, image)))
                errors = rms(raw), analysis.filtered_error(raw, 0 * raw), rms(left), rms(left)
                numbers.append(dict(zip(COLUMNS, errors, strict=True)) | split(left))
                numbers[-1][PREDICTED] = split(raw)[PREDICTED]
                shown.setdefault((dims, spp, name), (raw, left))
            rows.append(Row(f"flat {of}, {dims}-D", k < 2, dims, spp, name, _by_name(numbers)))
        progress(done / len(cases))
    return rows, shown


def _grey(denoise: Any, field: NDArray) -> NDArray[np.float64]:
    image = np.repeat(field[..., None], 3, -1).astype(np.float32)
    return np.asarray(denoise(image), np.float64).mean(-1)


def measure_scenes(size: Size, denoise: Any, progress: Callable[[float], None]) -> list[Row]:
    """Measure traced scenes."""
    rows: list[Row] = []
    side = size.side

    def images(scene: Any, sampler: str, spp: int, keys: range) -> NDArray[np.float64]:
        make, dims = CANDIDATES[sampler].make, len(scene.needs)
        return scene_images.of_keys(scene, [make(dims, side, side, spp, key) for key in keys], side, spp)

    for done, name in enumerate(size.scenes, start=1):
        scene = SCENES[name]()
        dims = len(scene.needs)
        exact = diffusion.reference(scene, side, REFERENCE).image
        seen = images(Features(scene), BASE, AUXILIARY, range(1))[0].astype(np.float32)
        for spp, sampler in product(size.counts_of_scenes, size.in_scenes):
            if dims <= CANDIDATES[sampler].most_dims:
                errors = [
                    (
                        rms(image - exact),
                        analysis.filtered_error(image, exact),
                        analysis.denoised_error(image, exact, denoise),
                        analysis.denoised_error(image, exact, denoise, seen[..., :3], seen[..., 3:]),
                    )
                    for image in images(scene, sampler, spp, range(1, size.keys_of_scenes + 1))
                ]
                numbers = _by_name([dict(zip(COLUMNS, of_key, strict=True)) for of_key in errors])
                rows.append(Row(name, True, dims, spp, sampler, numbers))
        progress(done / len(size.scenes))
    return rows


def measure_noise(side: int, denoise: Any) -> dict[str, dict[str, float]]:
    """Return the RMS error of noise of a kind after OIDN, over that of white noise, by its deviation."""
    frequency = _frequency(side)
    corner = np.isin(np.arange(side), side // 2)
    kinds = {
        "white": np.ones_like(frequency),
        "blue, none below 0.2": 1.0 * (frequency > 0.2),
        "blue, with a checkerboard": (frequency > 0.2) + 20 * np.outer(corner, corner),
        "narrow band": 1.0 * (np.abs(frequency - 0.45) < 0.02),
    }
    rng, left = np.random.default_rng(0), {}
    for name, amplitude in kinds.items():
        noises = [np.fft.ifft2(np.fft.fft2(rng.normal(size=(side, side))) * amplitude).real for _ in range(4)]
        left[name] = {
            f"{level:g}": rms(
                [_grey(denoise, 0.5 + 0.5 * level * noise / noise.std()) - 0.5 for noise in noises]
            )
            for level in DEVIATIONS
        }
    return {name: {level: of[level] / left["white"][level] for level in of} for name, of in left.items()}


def logarithms(rows: Sequence[Row], sampler: str, column: str) -> NDArray[np.float64]:
    """Return the mean over scenes and samples of ln(number / that of the base), by key."""
    base = {(of.scene, of.spp): of.numbers[column] for of in rows if of.sampler == BASE}
    own = [of for of in rows if of.sampler == sampler]
    return np.mean([np.log(np.divide(of.numbers[column], base[of.scene, of.spp])) for of in own], axis=0)


def summarize(rows: Sequence[Row]) -> dict[str, dict[str, judged.Ratio]]:
    """Return geometric means of ratios to the base by sampler and column, and in the worst scene."""
    found = {}
    for sampler in dict.fromkeys(of.sampler for of in rows if of.sampler != BASE):
        columns = {each: judged.of_logarithms(logarithms(rows, sampler, each)) for each in COLUMNS}
        cases = {(of.scene, of.spp) for of in rows if of.sampler == sampler}
        alone = [[of for of in rows if (of.scene, of.spp) == case] for case in cases]
        single = [judged.of_logarithms(logarithms(case, sampler, "OIDN")) for case in alone]
        found[sampler] = columns | {"worst, OIDN": max(single)}
    return found


def correlate(rows: Sequence[Row], column: str) -> dict[str, float]:
    """Return the rank correlation of a number with the error after OIDN: mean and interval over keys."""
    cases = {(of.dims, of.spp, of.sampler) for of in rows if of.sampler != BASE}
    pairs = [
        [
            logarithms([of for of in rows if (of.dims, of.spp) == (dims, spp)], sampler, each)
            for each in (column, "OIDN")
        ]
        for dims, spp, sampler in cases
    ]
    ranks = rankdata(np.array(pairs), axis=0)
    return judged.interval([np.corrcoef(*of_key.T)[0, 1] for of_key in np.moveaxis(ranks, -1, 0)])


def _shares(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Return the parts of the squared error after OIDN, by samples and sampler, over all flat fields."""
    found = {}
    for spp, sampler in dict.fromkeys((of.spp, of.sampler) for of in rows):
        own = [of for of in rows if (of.spp, of.sampler) == (spp, sampler)]
        squares = np.array([[of.numbers[name] for name in SHARES] for of in own])
        means = (squares / squares.sum(axis=1, keepdims=True)).mean((0, 2))
        found[f"{spp} spp, {sampler}"] = dict(zip(SHARES, means.tolist(), strict=True))
    return found


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
            "shares of the squared error after OIDN": _shares(flat),
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
    left, right = axes.get_xlim()
    ticks = [each for each in (0.4, 0.5, 0.6, 0.8, 1, 1.2, 1.5, 2, 3) if left < each < right]
    look = {"legend": "lower center", "bbox_to_anchor": (0.4, 1.1), "ncols": 2, "ticks": ticks}
    name_axes(axes, "relative error", title="traced scenes", log="x", **look)


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
