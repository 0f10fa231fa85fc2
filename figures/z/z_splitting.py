"""Z paper, Sect. 4.4: light samples of split paths as one set, beside other ways, at equal rays."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from matplotlib.figure import Figure
from numpy.typing import NDArray

import qmcjax as qj
from figures._rc import ORANGE, PURPLE, VERMILLION
from figures.making.schema import Found
from figures.shared import judged
from figures.shared.rendered import diffusion, padded_samplers, scene_images
from figures.shared.sheets.panels import legend_below, new_figure
from figures.z.z_renderings import constituents
from qmcjax import samplers, scenes, sequences
from qmcjax.core.bits import hash_pair, owen_hash, reverse, to_unit
from qmcjax.core.pytrees import pytree

SPP, COUNT = 4, 4
AROUND = (8, 16)
"""Samples without splitting: with two rays each, fewer and more rays than with splitting."""
SIDE = {"draft": 32, "paper": 64}
KEYS = {"draft": 4, "paper": 16}
REFERENCE_SPP = {"draft": 1024, "paper": 4096}
MEASURES = ("RMS error", "filtered error")
ONE, ARRAYS, ALONE, NONE = "one set", "arrays of each pixel", "each sample on its own", "no splitting"

NOTE = (
    f"Z-samplers by hashing on {{side}} x {{side}} pixels, {{keys}} keys. With splitting: {SPP} camera "
    f"samples, each with {COUNT} light samples, {SPP * (1 + COUNT)} rays of a pixel; without: the geometric "
    f"interpolation of errors at {AROUND[0]} and {AROUND[1]} samples, each of two rays, to as many rays. "
    "Camera samples are those of Z in all cases. Arrays of each pixel, as in PBRT: all light samples of a "
    "pixel are one (0,2)-set, xor-scrambled and shuffled, camera samples take consecutive blocks. On its "
    "own: the light samples of each camera sample are Owen-scrambled independently. Scenes are ours; "
    "filtered error is the RMS error after a Gaussian of 1.5 pixels. The paper only says that counts may "
    "differ, and compares nothing. "
)


@pytree
@dataclass(frozen=True)
class Alone(samplers.Sampler):
    """Each block of samples is the beginning of the Sobol' sequence, scrambled anew for each coordinate."""

    seed: Array
    coordinates: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        """Number of dimensions."""
        return self.coordinates

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return points in blocks of the number of light samples."""
        sobol, (x, y) = sequences.sobol(2), state
        block, number = sample // np.uint32(COUNT), sample % np.uint32(COUNT)
        own = hash_pair(hash_pair(x ^ self.seed, y), block)
        # Coordinates from 2 on are pairs after an even number of others, or single.
        words = [
            owen_hash(sobol.bit_reversed(number, (j + self.coordinates) % 2), hash_pair(own, jnp.uint32(j)))
            for j in dims
        ]
        return jnp.stack([to_unit(reverse(word), dtype) for word in words], axis=-1)


def ways(needs: tuple[str, ...], side: int, key: int) -> dict[str, samplers.Sampler]:
    """Return split samplers of light and camera by the name of the way: only light samples differ."""
    sizes = constituents(needs)
    lights = tuple(j for j, name in enumerate(needs) if name.startswith("light"))
    split = samplers.z(side, side, SPP, key, constituents=sizes).split(lights, COUNT)
    bits = (SPP * COUNT).bit_length() - 1
    arrays = padded_samplers.zero_two(sizes, key, key + 2**16, bits)
    alone = Alone(hash_pair(jnp.uint32(key), jnp.uint32(1)), len(needs))
    return {ONE: split, ARRAYS: replace(split, fine=arrays), ALONE: replace(split, fine=alone)}


def errors(scene: Any, exact: diffusion.Reference, side: int, key: int) -> dict[str, dict[str, float]]:
    """Return the measures of images of a key by the name of the way."""
    measure = partial(diffusion.measures, exact=exact)
    found = {
        name: measure(_image(scene, sampler, side, SPP * COUNT))
        for name, sampler in ways(scene.needs, side, key).items()
    }
    whole = [
        measure(_image(scene, sampler, side, spp))
        for spp in AROUND
        for sampler in [samplers.z(side, side, spp, key, constituents=constituents(scene.needs))]
    ]
    part = np.log2(SPP * (1 + COUNT) / 2 / AROUND[0])
    found[NONE] = {name: whole[0][name] ** (1 - part) * whole[1][name] ** part for name in MEASURES}
    return found


def _image(scene: Any, sampler: samplers.Sampler, side: int, spp: int) -> NDArray[np.float64]:
    return np.asarray(qj.render(scene, sampler, side, side, spp), np.float64)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Render the scenes in all ways, and compare their errors to those of one set."""
    side, keys = SIDE[quality], KEYS[quality]
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5)
    shadow = scene_images.quickly_compiled(scenes.soft_shadow(), quality)
    compared = {"soft shadow": shadow, "Cornell box": box, "occluder": scenes.occluder()}
    if quality == "draft":
        del compared["occluder"]  # Compilation takes most of a draft's time.
    measured: dict[str, dict[str, dict[str, NDArray]]] = {}
    for done, (title, scene) in enumerate(compared.items()):
        if title == "soft shadow":
            image, bound = scene.reference(side, side)
            exact = diffusion.Reference(image, np.full_like(image, bound), "exact")
        else:
            exact = diffusion.reference(scene, side, REFERENCE_SPP[quality], _image)
        found = []
        for key in range(keys):
            found.append(errors(scene, exact, side, key))
            progress((done + (key + 1) / keys) / len(compared))
        measured[title] = {
            measure: {name: np.array([of[name][measure] for of in found]) for name in found[0]}
            for measure in MEASURES
        }
    ratios = {
        title: {
            measure: {name: judged.ratio(of[name], of[ONE]) for name in of if name != ONE}
            for measure, of in measures.items()
        }
        for title, measures in measured.items()
    }
    numbers = {
        "measured": {
            "error over that of one set": ratios,
            "none over one set": {title: of["RMS error"][NONE]["mean"] for title, of in ratios.items()},
            "one set has less error": {
                measure: {name: _smaller(measured, measure, name) for name in (ALONE, ARRAYS)}
                for measure in MEASURES
            },
            "error of one set": {
                title: {measure: judged.interval(of[ONE]) for measure, of in measures.items()}
                for title, measures in measured.items()
            },
        },
        "claims": {"splitting has less error than none at equal rays": _smaller(measured, "RMS error", NONE)},
        "note": NOTE.format(side=side, keys=keys),
    }
    return _draw(ratios, side, keys), numbers


def _smaller(measured: dict[str, dict[str, dict[str, NDArray]]], measure: str, name: str) -> dict[str, Found]:
    """Return by scene whether one set has less error than another way."""
    return {title: judged.smaller(of[measure][ONE], of[measure][name]) for title, of in measured.items()}


def _draw(ratios: dict[str, dict[str, dict[str, dict[str, float]]]], side: int, keys: int) -> Figure:
    figure = new_figure(
        "Splitting as one set has least filtered error in shadows, none is better for edges\n"
        f"Z paper, Sect. 4.4; {SPP} camera samples with {COUNT} light samples each, {side} x {side} pixels, "
        f"{keys} keys, intervals of 95 %",
        2.9,
    )
    colors = dict(zip((NONE, ALONE, ARRAYS), (VERMILLION, ORANGE, PURPLE), strict=True))
    for axes, measure in zip(figure.subplots(1, 2), MEASURES, strict=True):
        for k, (name, color) in enumerate(colors.items()):
            of = [by_scene[measure][name] for by_scene in ratios.values()]
            middle = np.array([ratio["mean"] for ratio in of])
            ends = abs(np.array([[ratio[end] for ratio in of] for end in ("low", "high")]) - middle)
            axes.errorbar(
                np.arange(len(of)) + 0.2 * (k - 1), middle, ends, fmt="osD"[k], color=color, ms=5, label=name
            )
        axes.axhline(1, color="black", lw=1)
        axes.set_ylabel(f"{measure}\nover that of one set")
        axes.set_xticks(range(len(ratios)), list(ratios))
        axes.grid(axis="y", alpha=0.3)
    legend_below(figure, figure.axes[0], 3)
    return figure
