"""Tiles of the designed sampler, by :func:`analysis.design_samples`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import Filter, design_samples
from analysis._design.filters import autocorrelation
from qmcjax import progress_bar
from qmcjax.samplers.turned_tiles import tile_words

KEY = 1

_MEMORY = 0.1 * 0.9 ** np.arange(200)
"""Taps of an exponential moving average that keeps nine tenths in each frame."""

_IN_TIME = (
    Filter(1.5),
    Filter(1.5, _MEMORY),
    Filter(1.5, 1.5),
    Filter(0.0, _MEMORY),
    Filter(0.0, np.ones(8)),
)
"""One frame, frames in an average that forgets or in a Gaussian, and frames without a filter in space."""


_JOINT = {"half_spaces": 1.0, "half_planes": 1.0, "steps": 0.5}
"""In four dimensions: scenes often depend on the time alone, or on a point on a lens or light."""


def _equal(filters: tuple[Filter, ...], shape: tuple[int, ...]) -> list[Filter]:
    """Return filters with weights such that independent samples have equal errors after each of them."""
    return [one._replace(weight=1 / autocorrelation(shape, one)[0, 0, 0]) for one in filters]


TILES: dict[str, dict[str, Any]] = {
    "2d_1": {"side": 64, "spp": 1, "dims": 2, "steps": 1600},
    "2d_2": {"side": 64, "spp": 2, "dims": 2, "steps": 1000},
    "2d_4": {"side": 32, "spp": 4, "dims": 2, "steps": 1000},
    "2d_8": {"side": 32, "spp": 8, "dims": 2, "steps": 600},
    "2d_16": {"side": 16, "spp": 16, "dims": 2, "steps": 600},
    "4d_1": {"side": 64, "spp": 1, "dims": 4, "steps": 800},
    "4d_2": {"side": 64, "spp": 2, "dims": 4, "steps": 400},
    "4d_4": {"side": 32, "spp": 4, "dims": 4, "steps": 600},
    "4d_8": {"side": 16, "spp": 8, "dims": 4, "steps": 600},
    "4d_16": {"side": 16, "spp": 16, "dims": 4, "steps": 400},
    "2d_progressive": {"side": 32, "spp": 16, "dims": 2, "steps": 400, "progressive": True},
    "4d_progressive": {"side": 16, "spp": 16, "dims": 4, "steps": 400, "progressive": True},
    "frames": {"side": 32, "spp": 1, "dims": 2, "steps": 400, "frames": 32},
}
"""Smaller tiles where they serve as well: with more samples, strata of areas are as many."""


def tile(name: str) -> NDArray[np.uint16]:
    """Return the words of a tile."""
    how = dict(TILES[name])
    side, frames = how.pop("side"), how.get("frames")
    if how["dims"] == 4:
        how["integrands"] = _JOINT
    if frames:
        how["filters"] = _equal(_IN_TIME, (side, side, frames))
    points = design_samples(side, side, key=KEY, **how, progress=progress_bar(name)).points
    return tile_words(points if frames else points[:, :, None])


def table() -> Iterator[dict[str, NDArray]]:
    """Yield the tiles, one after the other."""
    tiles: dict[str, NDArray] = {}
    for name in TILES:
        tiles[name] = tile(name)
        yield tiles
