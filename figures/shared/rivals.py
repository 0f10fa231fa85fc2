"""What a sampler can be compared with, by short names for the command line."""

from collections.abc import Callable
from typing import Any, NamedTuple

from qmcjax import samplers, scenes, sequences
from qmcjax.choosing import CANDIDATES

Maker = Callable[..., samplers.Sampler]


class Rival(NamedTuple):
    """A sampler with its name in plots, and a function of (dims, width, height, spp, key) that makes it."""

    name: str
    make: Maker


def _candidate(name: str) -> Rival:
    """Return one of those to choose from, in as many of the dimensions as it has."""
    make, most_dims = CANDIDATES[name].make, CANDIDATES[name].most_dims
    return Rival(name, lambda dims, w, h, spp, key: make(min(dims, most_dims), w, h, spp, key))


RIVALS = {
    "random": _candidate("random"),
    "owen": _candidate("(0,2), Owen"),
    "lattice": _candidate("rank-1 lattice"),
    "sz": Rival("SZ, Owen", lambda dims, w, h, spp, key: samplers.independent(sequences.sz(dims), key)),
    "r2": Rival(
        "R2, rotated",
        lambda dims, w, h, spp, key: samplers.independent(sequences.roberts(dims), key, "shift"),
    ),
    "sobol": _candidate("Sobol', full screen"),
    "dither": _candidate("dither mask"),
    "ranked": _candidate("ranked keys"),
    "z": _candidate("Z, hash"),
    "optimized": _candidate("optimised orders"),
    "designed": _candidate("designed tiles"),
    "hilbert": _candidate("Hilbert, Owen-Sobol'"),
    "hilbert-halton": _candidate("Hilbert, Halton (2,3)"),
}

CLOSED: dict[str, Callable[[], Any]] = {
    "checkerboard": scenes.checkerboard,
    "zone-plate": scenes.zone_plate,
    "disc": scenes.disc,
    "triangle": scenes.triangle,
    "gaussian": scenes.gaussian,
    "ball": scenes.ball,
    "defocused-edge": scenes.defocused_edge,
    "soft-shadow": scenes.soft_shadow,
}
"""Scenes with a reference at any size, in closed form."""
