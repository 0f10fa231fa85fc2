"""Errors of samplers after a denoiser, of flat fields and traced scenes, and what it keeps of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from itertools import product
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.stats import rankdata

import analysis
from figures._errors import rms
from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.integrands_of_dims import CLASSES, COUNT
from figures.shared.rendered import diffusion, scene_images
from qmcjax import scenes, tracing
from qmcjax.choosing import CANDIDATES, DENOISED
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
    "paper": Size(SAMPLERS, (2, 4), (1, 2, 4, 8, 16, 64), 16, tuple(SCENES), IN_SCENES, (1, 4, 16), 128, 16),
}

COLUMNS = ("raw", "Gaussian", "OIDN", "OIDN, auxiliary")
LOW = 1 / 16
"""Cycles per pixel, below which errors are blotches."""

DEVIATIONS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Of noise, relative to its mean."""

SHARES = ("mean", "blotches", "texture")
PREDICTED = "predicted"


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


def divide_squares(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Return the parts of the squared error after OIDN, by samples and sampler, over all flat fields."""
    found = {}
    for spp, sampler in dict.fromkeys((of.spp, of.sampler) for of in rows):
        own = [of for of in rows if (of.spp, of.sampler) == (spp, sampler)]
        squares = np.array([[of.numbers[name] for name in SHARES] for of in own])
        means = (squares / squares.sum(axis=1, keepdims=True)).mean((0, 2))
        found[f"{spp} spp, {sampler}"] = dict(zip(SHARES, means.tolist(), strict=True))
    return found
