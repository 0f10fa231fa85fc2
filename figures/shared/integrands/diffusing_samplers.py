"""Samplers that diffuse errors over the pixels: those of the papers, and our optimised orders."""

from collections.abc import Callable

from figures.shared.integrands import screen_space
from qmcjax import orders, samplers, sequences
from qmcjax.choosing import CANDIDATES

Maker = Callable[[int, int, int], samplers.Sampler]
"""From a side, a number of samples and a key."""


KEYLESS = (
    "dither, vectors",
    "Z0",
    "Hilbert, Halton (2,3)",
    "Hilbert, Halton (3,5)",
    "Moore, Halton (2,3)",
    "Peano, Halton (2,5)",
    "Hilbert, shifted lattice",
    "Hilbert, segments (3,5)",
    "Hilbert, partitioned",
)
"""Those samplers of the papers that diffuse errors and have nothing random."""

KEYED = {
    "dither, rotated": "dither mask",
    "ranked keys": "ranked keys",
    "Z, hash": "Z, hash",
    "Hilbert, Owen-Halton": "Hilbert, Halton (2,3)",
    "Hilbert, Owen-Sobol'": "Hilbert, Owen-Sobol'",
}
"""Those with keys, and what they are called among the candidates."""


def keyless() -> dict[str, Maker]:
    """Return those that have nothing random."""
    methods = screen_space.methods()
    return {name: lambda side, spp, _, make=methods[name].make: make(side, spp) for name in KEYLESS}


def keyed() -> dict[str, Maker]:
    """Return those with keys."""
    made = {name: _candidate(called) for name, called in KEYED.items()}
    return made | {"Z, ART": lambda side, spp, key: samplers.z(side, side, spp, key, "art")}


def _candidate(name: str) -> Maker:
    make = CANDIDATES[name].make
    return lambda side, spp, key: make(2, side, side, spp, key)


ours, in_rows = _candidate("optimised orders"), _candidate("raster, Owen-Sobol'")


def drawn(side: int, spp: int, key: int) -> samplers.Sampler:
    """Return the same with permutations that are drawn: blocks of the same kind in Z's order."""
    return samplers.contiguous(
        orders.scrambled_morton(side, side, key), sequences.owen(sequences.sobol(2), key), spp
    )
