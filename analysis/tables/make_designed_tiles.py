"""Make the tiles of the designed sampler: ``python -m analysis.tables.make_designed_tiles``.

About half an hour on two cores.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

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


def tile(name: str, folder: Path) -> np.ndarray:
    """Return the words of a tile; a run that was interrupted goes on."""
    how = dict(TILES[name])
    side, frames = how.pop("side"), how.get("frames")
    if how["dims"] == 4:
        how["integrands"] = _JOINT
    if frames:
        how["filters"] = _equal(_IN_TIME, (side, side, frames))
    kept = folder / f"{name}.checkpoint"
    made = design_samples(side, side, key=KEY, **how, progress=progress_bar(name), checkpoint=kept)
    print(f"{name}: expected error {made.errors[0]:.5f}, designed {made.errors[-1]:.5f}", flush=True)
    return tile_words(made.points if frames else made.points[:, :, None])


def main(arguments: list[str] | None = None) -> None:
    """Make the tiles that are asked for, and write them with those there are."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(TILES)}; all by default")
    parser.add_argument("--folder", type=Path, default=Path("qmcjax/samplers/_data"))
    wanted = parser.parse_args(arguments)
    names = wanted.names or list(TILES)
    if not set(names) <= set(TILES):
        sys.exit(f"names must be of {', '.join(TILES)}, got {' '.join(names)}")
    target = wanted.folder / "designed.npz"
    tiles = {}
    if target.exists():
        with np.load(target) as there:
            tiles = dict(there)
    for name in names:
        tiles[name] = tile(name, wanted.folder)
        temporary = target.with_suffix(".part.npz")
        np.savez(temporary, allow_pickle=False, **{key: tiles[key] for key in TILES if key in tiles})
        temporary.replace(target)
        (wanted.folder / f"{name}.checkpoint").unlink(missing_ok=True)


if __name__ == "__main__":
    main()
