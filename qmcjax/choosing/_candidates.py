"""The candidates: samplers of the papers and ours, by name, with one signature."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from qmcjax import orders, samplers, sequences

MOST = 250
"""Dimensions of all candidates without a smaller limit: those of the lattice."""


@dataclass(frozen=True)
class Candidate:
    """A family of samplers."""

    make: Callable[[int, int, int, int, Any], samplers.Sampler]
    """Makes a sampler from dimensions, width, height, samples per pixel and key."""
    most_dims: int = MOST

    powers_of_two: bool = False
    """Whether it has one sample per pixel only."""

    def takes(self, dims: int, spp: int) -> bool:
        """Return whether it exists for these dimensions and samples per pixel."""
        return dims <= self.most_dims and not (self.powers_of_two and spp & (spp - 1))


def _owen(dims: int, key: Any) -> Any:
    return sequences.owen(sequences.sobol(dims), key)


def _random(dims: int, width: int, height: int, spp: int, key: Any) -> samplers.Sampler:
    return samplers.contiguous(orders.raster(width, height), sequences.uniform(dims, key), spp)


def _permutation(dims: int, width: int, height: int, spp: int, key: Any) -> samplers.Sampler:
    digits = 2 * (max(width, height) - 1).bit_length() + spp.bit_length() - 1
    if digits > 32:
        raise ValueError(
            "width and height must leave at most 2**32 samples to a permutation net over the next square, "
            f"got {width} x {height} at {spp} spp, 2**{digits}"
        )
    net = sequences.permutation_net(digits)
    return samplers.full_screen(sequences.digital_shift(net, key), width, height)


CANDIDATES: dict[str, Candidate] = {
    "random": Candidate(_random),
    # One set in each pixel.
    "(0,2), Owen": Candidate(
        lambda dims, width, height, spp, key: samplers.independent(sequences.sobol(dims), key)
    ),
    "rank-1 lattice": Candidate(
        lambda dims, width, height, spp, key: samplers.independent(
            sequences.lattice(dims), key, randomize="shift"
        )
    ),
    # One set over the screen.
    "Sobol', full screen": Candidate(
        lambda dims, width, height, spp, key: samplers.full_screen(
            sequences.digital_shift(sequences.sobol(dims), key), width, height
        )
    ),
    "Halton, full screen": Candidate(
        lambda dims, width, height, spp, key: samplers.full_screen(
            sequences.halton(dims, "random", key), width, height
        )
    ),
    "permutation": Candidate(_permutation, most_dims=2, powers_of_two=True),
    # Optimised for small errors after a filter.
    "dither mask": Candidate(
        lambda dims, width, height, spp, key: samplers.dither(
            samplers.blue_noise_mask(2), sequences.rotate(sequences.lattice(dims), key)
        )
    ),
    "ranked keys": Candidate(lambda dims, width, height, spp, key: samplers.ranked(dims, key), most_dims=4),
    "designed tiles": Candidate(
        lambda dims, width, height, spp, key: samplers.designed(width, height, spp, key, dims),
        powers_of_two=True,
    ),
    # Along Morton order, with random or optimised permutations.
    "Z0": Candidate(
        lambda dims, width, height, spp, key: samplers.z(
            width, height, spp, None, "plain", sequence=_owen(dims, key)
        ),
        powers_of_two=True,
    ),
    "Z, hash": Candidate(
        lambda dims, width, height, spp, key: samplers.z(width, height, spp, key, dims=dims),
        powers_of_two=True,
    ),
    "Z, joint": Candidate(
        lambda dims, width, height, spp, key: samplers.z(width, height, spp, key, sequence=_owen(dims, key)),
        powers_of_two=True,
    ),
    "optimised orders": Candidate(
        lambda dims, width, height, spp, key: samplers.optimized(width, height, spp, key, dims),
        powers_of_two=True,
    ),
    # Along other curves.
    "raster, Owen-Sobol'": Candidate(
        lambda dims, width, height, spp, key: samplers.contiguous(
            orders.raster(width, height), _owen(dims, key), spp
        )
    ),
    "Hilbert, Owen-Sobol'": Candidate(
        lambda dims, width, height, spp, key: samplers.contiguous(
            orders.hilbert(width, height), _owen(dims, key), spp
        )
    ),
    "Hilbert, Halton (2,3)": Candidate(
        lambda dims, width, height, spp, key: samplers.contiguous(
            orders.hilbert(width, height), sequences.owen(sequences.halton(dims), key), spp
        )
    ),
    "Hilbert, shifted lattice": Candidate(
        lambda dims, width, height, spp, key: samplers.shifted(
            orders.hilbert(width, height), sequences.halton(dims, "random", key), sequences.lattice(dims)
        )
    ),
}
"""By their names in plots. Each key gives another sampler with the same program."""
