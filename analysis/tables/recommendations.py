"""Measure the errors of all available samplers: the tables behind ``qmcjax.recommend``.

Existing rows of samplers are kept: delete those of a sampler to measure it again.

The points of a sampler have the largest number of dimensions of a level; scenes with fewer take the first
coordinates. All scenes of a level are evaluated at the same points, with several keys, in images of two
sizes: a square with a power of 2 as side, for which many samplers are made, and one that is neither. For each
scene and size the root mean square of its errors over the keys is stored, as 1000 ln(error / error of random
samples).

Animations show a still scene in 32 frames, seen through a moving average with a tenth of each new frame. The
frames repeat, and all frames count. Images that are shown while they are rendered have an error at the first
1, 2, 4, ... of their samples: the logarithms of these are averaged.
"""

import csv
import io
from collections.abc import Iterator, Sequence
from functools import cache, partial
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from analysis import filtered_error
from analysis.tables import CHOOSING
from qmcjax import scenes
from qmcjax.choosing import ANIMATED, LEVELS, MEASURES, SETTINGS, SHOWN, Candidate, Setting, has_edges

BASE = "random"
"""The reference for errors."""

FRAMES, ALPHA = 32, 0.1
"""Frames of an animation, and the weight of a new frame in the moving average."""

SHIFTS = (0.37, 0.61, 0.43, 0.71, 0.29, 0.55, 0.67, 0.33)
"""Positions of the peaks, kinks and jumps of the Genz families, away from fractions used by samplers."""

SCENES: dict[int, dict[str, Any]] = {
    2: {
        "checkerboard": scenes.checkerboard(),
        "flat checkerboard": scenes.flat_checkerboard(),
        "step": scenes.step(),
        "staircase": scenes.staircase(),
        "line": scenes.line(),
        "disc": scenes.disc(),
        "triangle": scenes.triangle(),
        "heaviside": scenes.heaviside(2, 0.931),
        "zone plate": scenes.zone_plate(),
        "gaussian": scenes.gaussian(),
    },
    4: {
        "moving edge": scenes.moving_edge(),
        "blinking disc": scenes.blinking_disc(on=(0.21, 0.73)),
        "ball": scenes.ball(times=(0.57,)),
        "defocused edge": scenes.defocused_edge(),
        "soft shadow": scenes.soft_shadow(),
        "heaviside 3": scenes.heaviside(3, 1.37),
        "heaviside 4": scenes.heaviside(4, 1.91),
        "path 1": scenes.path_toy(1, survival=None),
    },
    8: {
        "heaviside 5": scenes.heaviside(5, 2.43),
        "heaviside 6": scenes.heaviside(6, 2.87),
        "heaviside 8": scenes.heaviside(8, 3.91),
        "path 1, roulette": scenes.path_toy(1, survival=0.6),
        "path 2": scenes.path_toy(2, survival=None),
        "path 2, roulette": scenes.path_toy(2, survival=0.6),
        "path 3": scenes.path_toy(3, survival=None),
    },
}
"""By level; none is ray-traced."""

for level, of_level in SCENES.items():
    for family in ("oscillatory", "product_peak", "corner_peak", "gaussian", "continuous"):
        for difficulty in (1.0, 3.0):
            made = scenes.genz(family, level, difficulty, SHIFTS[:level])
            of_level[f"genz {family} {level}, {difficulty:g}"] = made
    of_level[f"genz discontinuous {level}"] = scenes.genz("discontinuous", level, 0.5, SHIFTS[:level])


@partial(jax.jit, static_argnames=("level", "width", "height"))
def points(sampler: Any, level: int, width: int, height: int, sample: Array) -> Array:
    """Return one sample of each pixel, coordinates on the screen first: shape (height, width, level)."""
    y, x = jnp.mgrid[:height, :width].astype(jnp.uint32)
    point = sampler(x, y, jnp.full_like(x, sample), tuple(range(level)))
    corner = jnp.stack([x, y], axis=-1).astype(point.dtype)
    size = jnp.array([[[width, height]]], point.dtype)
    return jnp.concatenate([(point[..., :2] + corner) / size, point[..., 2:]], axis=-1)


@jax.jit
def add(total: Array, point: Array) -> Array:
    """Add the values of all scenes of a level, shape (scenes, height, width)."""
    of_level = SCENES[point.shape[-1]].values()
    return total + jnp.stack([scene(point[..., : len(scene.needs)]) for scene in of_level])


def images(sampler: Any, level: int, width: int, height: int, spp: int) -> NDArray[np.float64]:
    """Return images of all scenes of a level. Their program is compiled once, apart from the samplers'."""
    return growing(sampler, level, width, height, spp, (spp,))[0]


def growing(
    sampler: Any, level: int, width: int, height: int, spp: int, counts: Sequence[int]
) -> list[NDArray[np.float64]]:
    """Return the images of the first so many samples, for several counts."""
    total, made = jnp.zeros((len(SCENES[level]), height, width)), []
    for sample in range(spp):
        total = add(total, points(sampler, level, width, height, jnp.uint32(sample)))
        if sample + 1 in counts:
            made.append(np.asarray(total, np.float64) / (sample + 1))
    return made


def moving_average(frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the moving average of frames that repeat, along the first axis, after many rounds of them."""
    weights = ALPHA * (1 - ALPHA) ** np.arange(6 * len(frames))
    folded = weights.reshape(-1, len(frames)).sum(axis=0)
    transfer = np.fft.fft(folded / folded.sum()).reshape(-1, *(1,) * (frames.ndim - 1))
    return np.fft.ifft(np.fft.fft(frames, axis=0) * transfer, axis=0).real


@cache
def exact(level: int, width: int, height: int) -> list[NDArray[np.float64]]:
    """Return the limit of the images."""
    return [scene.reference(width, height)[0] for scene in SCENES[level].values()]


def _images(
    candidate: Candidate, setting: Setting, level: int, size: tuple[int, int], spp: int, key: int
) -> list[NDArray[np.float64]]:
    """Return the images, shape (scenes, height, width), that a setting counts."""
    how = level, *size, spp
    if setting is ANIMATED:
        each = [images(candidate.make(*how, key, np.uint32(t)), *how) for t in range(FRAMES)]
        return list(moving_average(np.stack(each)))
    counts = [2**k for k in range(spp.bit_length())] if setting is SHOWN else [spp]
    return growing(candidate.make(*how, key), *how, counts)


def errors(
    candidate: Candidate, setting: Setting, level: int, size: tuple[int, int], spp: int, keys: range
) -> NDArray[np.float64]:
    """Return the errors of the images that count, shape (images, measures, scenes, keys)."""
    found = []
    for key in keys:
        for drawn in _images(candidate, setting, level, size, spp, key):
            each = list(zip(drawn, exact(level, *size), strict=True))
            rms = [np.sqrt(np.mean((image - reference) ** 2)) for image, reference in each]
            found.append([rms, [filtered_error(image, reference) for image, reference in each]])
    made = np.reshape(found, (len(keys), -1, len(MEASURES), len(SCENES[level])))
    return made.transpose(1, 2, 3, 0)


def logarithm(errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ln(error), shape (measures, scenes): of squares averaged over keys, on average over images."""
    return 0.5 * np.log(np.mean(np.square(errors), axis=-1)).mean(axis=0)


Logarithms = dict[tuple[int, tuple[int, int]], NDArray[np.float64]]
"""ln(error) by level and size, shape (scenes, measures, numbers of samples)."""


def logarithms(candidate: Candidate, setting: Setting) -> Logarithms:
    """Measure a candidate at all levels that it has the dimensions for."""
    found = {}
    for level, size in product(LEVELS, setting.sizes):
        if candidate.least_dims <= level <= candidate.most_dims:
            keys = range(setting.keys)
            of_spp = [logarithm(errors(candidate, setting, level, size, spp, keys)) for spp in setting.spps]
            found[level, size] = np.transpose(of_spp, (2, 1, 0))
    return found


def rows(name: str, setting: Setting, base: Logarithms) -> Iterator[list[str]]:
    """Yield the rows of a sampler."""
    found = base if name == BASE else logarithms(setting.candidates[name], setting)
    for (level, size), of_scenes in found.items():
        relative = np.rint(1000 * (of_scenes - base[level, size])).astype(int)
        for (scene, made), numbers in zip(SCENES[level].items(), relative, strict=True):
            kind = "edges" if has_edges(made) else "smooth"
            yield [scene, kind, str(level), "{} x {}".format(*size), name, *map(str, numbers.ravel())]


def table(of: str) -> Iterator[bytes]:
    """Yield the table of a setting with the rows that were missing, sampler after sampler."""
    setting = SETTINGS[of]
    names, path = list(setting.candidates), CHOOSING / setting.file
    numbers = [f"{measure} at {spp} spp" for measure in MEASURES for spp in setting.spps]
    known: list[list[str]] = []
    if path.exists():
        with path.open(encoding="utf-8", newline="") as stream:
            known = [row for row in csv.reader(stream) if not row[0].startswith("#")][1:]
    base = logarithms(setting.candidates[BASE], setting)
    for name in [name for name in names if name not in {row[4] for row in known}]:
        known = sorted([*known, *rows(name, setting, base)], key=lambda row: names.index(row[4]))
        text = io.StringIO(newline="")
        text.write(f"# 1000 ln(error / error of {BASE}); {setting.keys} keys\n")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerows([["scene", "kind", "level", "size", "sampler", *numbers], *known])
        yield text.getvalue().encode()
