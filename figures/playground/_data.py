"""The script that a page loads for its playground: samplers and scenes as shaders, and exact images."""

import base64
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from figures.making.web_images import slug
from figures.shared.rivals import CLOSED, RIVALS
from qmcjax import samplers
from qmcjax.bridges import seeds, source
from qmcjax.samplers import Sampler

Place = list[int]
"""Where an array begins and ends."""


class Blob:
    """The bytes of arrays; equal ones are kept once."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._known: dict[bytes, Place] = {}

    def planes(self, numbers: NDArray[Any], count: int) -> Place:
        """Add whole numbers of ``count`` bytes: the lowest bytes of all first, then the next."""
        words = numbers.astype(np.uint32)
        return self._add(b"".join((words >> (8 * k)).astype(np.uint8).tobytes() for k in range(count)))

    def floats(self, numbers: NDArray[np.float64]) -> Place:
        """Add floats as they are."""
        return self._add(numbers.astype("<f8").tobytes())

    def _add(self, data: bytes) -> Place:
        if data not in self._known:
            self._known[data] = [len(self._data), len(self._data) + len(data)]
            self._data += data
        return self._known[data]

    def pack(self, described: Mapping[str, Any]) -> str:
        """Return base64 of what is compressed: the length of the JSON in 4 bytes, the JSON, the arrays."""
        head = json.dumps(described, separators=(",", ":")).encode()
        data = len(head).to_bytes(4, "little") + head + self._data
        return base64.b64encode(zlib.compress(data, 9)).decode()


Maker = Callable[[int, int], Sampler]
"""From a number of samples and a key to a sampler."""

Known = list[tuple[Sampler, int, Place | None]]
"""Samplers that were translated, with the numbers of their texts and their tables."""


class Programs:
    """The programs of all samplers, whose texts and tables are kept once.

    A program is the number of its text, its tables, if it has any, and its seeds.
    """

    def __init__(self, side: int, blob: Blob) -> None:
        self.texts: list[str] = []
        self._side, self._blob = side, blob

    def add(self, make: Maker, counts: Sequence[int], keys: Sequence[int], most_dims: int) -> dict[str, Any]:
        """Return the programs of one method, by counts, then by keys: or in words why there is none."""
        found: dict[str, Any] = {"dims": 0, "programs": []}
        known: Known = []
        for count in counts:
            try:
                made = [self._make(make, count, key, max(counts)) for key in keys]
                found["dims"] = min(made[0].dims, most_dims)
                programs: Any = [self._program(each, found["dims"], known) for each in made]
            except Exception as error:  # The samplers of users raise what they like.
                programs = str(error) or type(error).__name__
            found["programs"].append(programs)
        return found

    def _make(self, make: Maker, count: int, key: int, most: int) -> Sampler:
        sampler = make(count, key)
        sampler.check(self._side, self._side, count)
        return sampler.up_to(min(most, sampler.fits.spp))

    def _program(self, sampler: Sampler, dims: int, known: Known) -> list[Any]:
        for other, text, tables in known:
            try:
                return [text, tables, seeds(other, sampler).tolist()]
            except ValueError:
                continue
        made = source(sampler, tuple(range(dims)), "glsl", "mine")
        if made not in self.texts:
            self.texts.append(str(made))
        tables = self._blob.planes(made.tables, 4) if made.tables.size else None
        known.append((sampler, self.texts.index(made), tables))
        return [*known[-1][1:], seeds(sampler, sampler).tolist()]


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
            worlds.append({"id": slug(name), "name": name} | _describe(scene, reference, blob))
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
    return Playground(f'window.playgroundData = "{blob.pack(data)}";\n', left_out)


def _describe(scene: Any, reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return the number of coordinates of a scene, its function, and where its exact image is.

    Raises ValueError if its values are colours or not in [0, 1], or the scene cannot be translated.
    """
    if reference.ndim > 2:
        raise ValueError("its values are colours")
    if reference.min() < 0 or reference.max() > 1:
        raise ValueError("its values are not in [0, 1]")
    text = str(source(scene, language="glsl", name="scene"))
    return {"needs": len(scene.needs), "text": text} | _exact_image(reference, blob)


def _exact_image(reference: NDArray[np.float64], blob: Blob) -> dict[str, Any]:
    """Return an image as levels, or as columns and rows whose products add up to it."""
    columns, sizes, rows = np.linalg.svd(reference, full_matrices=False)
    columns = (columns * sizes)[:, :MOST_FACTORS]
    if np.abs(columns @ rows[:MOST_FACTORS] - reference).max() < 0.1 / LEVELS:
        return {"columns": blob.floats(columns.T), "rows": blob.floats(rows[:MOST_FACTORS])}
    return {"levels": blob.planes(np.round(reference * LEVELS), 3)}


SAMPLERS = {rival.name: rival for name, rival in RIVALS.items() if name != "hilbert-halton"}
"""All but one with 57 kB of program and tables."""

SCENES = {name.replace("-", " "): make for name, make in CLOSED.items()}

COUNTS = (1, 4, 16, 64, 256)

DIMS = 4
"""As many as one of the scenes needs."""

START: dict[str, Any] = {
    "left": RIVALS["random"].name,
    "right": RIVALS["z"].name,
    "scene": "soft shadow",
    "spp": 1,
    "filter": "gaussian",
    "view": "difference",
}


def make_sampler(name: str, side: int, count: int, key: int) -> samplers.Sampler:
    """Return one of the samplers."""
    return SAMPLERS[name].make(DIMS, side, side, count, key)


def ours(side: int) -> Playground:
    """Return the playground with our samplers, for square images."""
    worlds = {name: make() for name, make in SCENES.items()}
    exact = {name: (scene, scene.reference(side, side)[0]) for name, scene in worlds.items()}
    makers = {name: partial(make_sampler, name, side) for name in SAMPLERS}
    return playground(makers, exact, side, COUNTS, start=START)
