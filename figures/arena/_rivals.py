"""What a sampler can be compared with, by short names for the command line."""

from collections.abc import Callable
from typing import Any, NamedTuple

from qmcjax import orders, samplers, scenes, sequences

Maker = Callable[..., samplers.Sampler]


class Rival(NamedTuple):
    """A sampler with its name in plots, and a function of (dims, width, height, spp, key) that makes it."""

    name: str
    make: Maker


def _owen(dims: int, key: int) -> sequences.Sequence:
    return sequences.owen(sequences.sobol(dims), key)


RIVALS = {
    "random": Rival(
        "random",
        lambda dims, w, h, spp, key: samplers.contiguous(
            orders.raster(w, h), sequences.uniform(dims, key), spp
        ),
    ),
    "owen": Rival(
        "(0,2), Owen", lambda dims, w, h, spp, key: samplers.independent(sequences.sobol(dims), key)
    ),
    "lattice": Rival(
        "rank-1 lattice",
        lambda dims, w, h, spp, key: samplers.independent(sequences.lattice(dims), key, "shift"),
    ),
    "sz": Rival("SZ, Owen", lambda dims, w, h, spp, key: samplers.independent(sequences.sz(dims), key)),
    "r2": Rival(
        "R2, rotated",
        lambda dims, w, h, spp, key: samplers.independent(sequences.roberts(dims), key, "shift"),
    ),
    "sobol": Rival(
        "Sobol', full screen",
        lambda dims, w, h, spp, key: samplers.full_screen(
            sequences.digital_shift(sequences.sobol(dims), key), w, h
        ),
    ),
    "dither": Rival(
        "dither mask",
        lambda dims, w, h, spp, key: samplers.dither(
            samplers.blue_noise_mask(min(dims, 2)), sequences.rotate(sequences.lattice(min(dims, 2)), key)
        ),
    ),
    "ranked": Rival("ranked (Heitz)", lambda dims, w, h, spp, key: samplers.ranked(min(dims, 4), key)),
    "z": Rival("Z, hash", lambda dims, w, h, spp, key: samplers.z(w, h, spp, key, dims=dims + dims % 2)),
    "optimized": Rival(
        "optimised orders", lambda dims, w, h, spp, key: samplers.optimized(w, h, spp, key, dims)
    ),
    "hilbert": Rival(
        "Hilbert, Owen-Sobol'",
        lambda dims, w, h, spp, key: samplers.contiguous(orders.hilbert(w, h), _owen(dims, key), spp),
    ),
    "hilbert-halton": Rival(
        "Hilbert, Halton (2,3)",
        lambda dims, w, h, spp, key: samplers.contiguous(
            orders.hilbert(w, h), sequences.owen(sequences.halton(dims), key), spp
        ),
    ),
}

SCENES: dict[str, Callable[[], Any]] = {
    "checkerboard": scenes.checkerboard,
    "zone-plate": scenes.zone_plate,
    "disc": scenes.disc,
    "triangle": scenes.triangle,
    "gaussian": scenes.gaussian,
    "ball": scenes.ball,
    "defocused-edge": scenes.defocused_edge,
    "soft-shadow": scenes.soft_shadow,
    "cornell-box": scenes.cornell_box,
    "helicopter": scenes.helicopter,
    "occluder": scenes.occluder,
    "defocus": scenes.defocus,
    "sports": scenes.sports,
}
"""Those with a reference at any size come first."""


def rivals(names: list[str], dims: int) -> dict[str, Maker]:
    """Return makers of samplers with as many dimensions, by their names in plots."""
    return {RIVALS[name].name: _of(RIVALS[name].make, dims) for name in names}


def _of(make: Maker, dims: int) -> Maker:
    def maker(width: int, height: int, spp: int, key: int) -> samplers.Sampler:
        return make(dims, width, height, spp, key)

    return maker
