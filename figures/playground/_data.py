"""The script that a page loads for its playground: samplers, and scenes with their exact images."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.making.web_images import slug
from figures.playground._blob import Blob
from figures.playground._programs import Maker, Programs
from qmcjax.bridges import source

KEYS = tuple(range(1, 17))

LEVELS = 2**24 - 1
"""Values from 0 to 1 of exact images: rounded to 24 bits, they are off by at most 3e-8."""

MOST_FACTORS = 4
"""Images of a lower rank are kept as factors, which are smaller and more precise."""


class Playground(NamedTuple):
    script: str
    """Empty if no sampler or no scene is left."""
    left_out: dict[str, str]
    """Samplers and scenes that are not in it, and why."""


def playground(
    makers: Mapping[str, Maker],
    scenes: Mapping[str, tuple[Any, NDArray[np.float64]]],
    side: int,
    counts: Sequence[int],
    keys: Sequence[int] = KEYS,
    start: Mapping[str, str | int] = MappingProxyType({}),
) -> Playground:
    """Translate samplers and scenes for a playground.

    ``makers``: functions of a number of samples and a key, by samplers' names. ``scenes``: scenes and their
    exact images. ``side``: of the images in pixels. ``counts``: samples per pixel. ``start``: what is shown
    first: left and right, a sampler each, scene and spp. A sampler is left out if no number of samples has a
    program.
    """
    left_out: dict[str, str] = {}
    blob, worlds = Blob(), []
    for name, (scene, reference) in scenes.items():
        try:
            worlds.append({"id": slug(name), "name": name} | _described(scene, reference, blob))
        except ValueError as error:
            left_out[name] = str(error)
    programs, samplers = Programs(side, blob), []
    most_dims = max((world["needs"] for world in worlds), default=2)
    for name, make in makers.items():
        of = programs.add(make, counts, keys, most_dims)
        if all(isinstance(each, str) for each in of["programs"]):
            left_out[name] = of["programs"][0]
        else:
            samplers.append({"id": slug(name), "name": name} | of)
    if not (samplers and worlds):
        return Playground("", left_out)
    shown = {each: slug(value) if isinstance(value, str) else value for each, value in start.items()}
    data = {
        "side": side,
        "counts": list(counts),
        "keys": list(keys),
        "start": {each: value for each, value in shown.items() if start[each] not in left_out},
        "levels": LEVELS,
        "samplers": samplers,
        "scenes": worlds,
        "texts": programs.texts,
    }
    return Playground(f'window.playgroundData = "{blob.packed(data)}";\n', left_out)


def _described(scene: Any, reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return the number of coordinates of a scene, its function, and where its exact image is.

    Raises ValueError if its values are colours or not in [0, 1], or the scene cannot be translated.
    """
    if reference.ndim > 2:
        raise ValueError("its values are colours")
    if reference.min() < 0 or reference.max() > 1:
        raise ValueError("its values are not in [0, 1]")
    text = str(source(scene, language="glsl", name="scene"))
    return {"needs": len(scene.needs), "text": text} | _exact(reference, blob)


def _exact(reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return an image as levels, or as columns and rows whose products add up to it."""
    columns, sizes, rows = np.linalg.svd(reference, full_matrices=False)
    columns = (columns * sizes)[:, :MOST_FACTORS]
    if np.abs(columns @ rows[:MOST_FACTORS] - reference).max() < 0.1 / LEVELS:
        return {"columns": blob.floats(columns.T), "rows": blob.floats(rows[:MOST_FACTORS])}
    return {"levels": blob.planes(np.round(reference * LEVELS), 3)}
