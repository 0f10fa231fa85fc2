"""The candidates: samplers of the papers and ours, by name, with one signature for images, one for frames."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import jax

from qmcjax import orders, samplers, sequences
from qmcjax.core import checks

MOST = 250
"""Dimensions of all candidates without a smaller limit: those of the lattice."""

_TILED = 2**16
"""Most samples per pixel of tiles."""


@dataclass(frozen=True)
class Candidate:
    """A family of samplers."""

    make: Callable[..., samplers.Sampler]
    """Makes a sampler from dimensions, width, height, samples per pixel and key; for animations, also from
    the number of a frame."""
    most_dims: int = MOST
    least_dims: int = 1
    """Fewest dimensions; with fewer it equals another candidate."""
    powers_of_two: bool = False
    """Whether its number of samples per pixel must be a power of two."""
    most_spp: int = 2**31
    """Most samples per pixel in images of any size."""

    def takes(self, dims: int, spp: int) -> bool:
        fits = self.least_dims <= dims <= self.most_dims and spp <= self.most_spp
        return fits and not (self.powers_of_two and spp & (spp - 1))


def _owen(dims: int, key: Any) -> Any:
    return sequences.owen(sequences.sobol(dims), key)


def _along(curve: Callable[[int, int], orders.Order], sequence: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that makes contiguous blocks along a curve, of a sequence of dims, key and frame."""

    def make(dims: int, width: int, height: int, spp: int, key: Any, *frame: Any) -> samplers.Sampler:
        return samplers.contiguous(curve(width, height), sequence(dims, key, *frame), spp)

    return make


def _masked(dims: int, width: int, height: int, spp: int, key: Any) -> Any:
    lattice = sequences.rotate(sequences.lattice(dims), key)
    return samplers.dither(samplers.blue_noise_mask(2), lattice)


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
    "random": Candidate(_along(orders.raster, sequences.uniform)),
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
    # Optimised for small filtered errors.
    "dither mask": Candidate(_masked),
    "ranked keys": Candidate(lambda dims, width, height, spp, key: samplers.ranked(dims, key), most_dims=4),
    "designed tiles": Candidate(
        lambda dims, width, height, spp, key: samplers.designed(width, height, spp, key, dims),
        powers_of_two=True,
        most_spp=_TILED,
    ),
    # Along a Morton order with random or optimised permutations.
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
    "raster, Owen-Sobol'": Candidate(_along(orders.raster, _owen)),
    "Hilbert, Owen-Sobol'": Candidate(_along(orders.hilbert, _owen)),
    "Hilbert, Niederreiter-Xing": Candidate(
        _along(orders.hilbert, lambda dims, key: sequences.owen(sequences.niederreiter_xing(dims), key)),
        most_dims=11,
        least_dims=3,
    ),
    "Hilbert, Halton (2,3)": Candidate(
        _along(orders.hilbert, lambda dims, key: sequences.owen(sequences.halton(dims), key))
    ),
    "Hilbert, shifted lattice": Candidate(
        lambda dims, width, height, spp, key: samplers.shifted(
            orders.hilbert(width, height), sequences.halton(dims, "random", key), sequences.lattice(dims)
        )
    ),
}
"""By their names in plots. A new key does not recompile."""


def _fresh(name: str) -> Candidate:
    still = CANDIDATES[name]

    def make(dims: int, width: int, height: int, spp: int, key: Any, frame: Any) -> samplers.Sampler:
        return still.make(dims, width, height, spp, jax.random.fold_in(checks.prng_key("key", key), frame))

    return replace(still, make=make)


def _golden(dims: int, key: Any, frame: Any) -> Any:
    """Rotate a sequence by a point of the Roberts sequence (generalised golden ratio) for each frame."""
    return sequences.rotate(_owen(dims, key), sequences.roberts(dims)(frame))


def _moving(sampler: Callable[..., Any]) -> Candidate:
    """Return a candidate that moves its samples from frame to frame."""

    def make(dims: int, width: int, height: int, spp: int, key: Any, frame: Any) -> samplers.Sampler:
        return sampler(width, height, spp, key, dims=dims, frames=32).at_frame(frame)

    return Candidate(make, powers_of_two=True)


FRAMES: dict[str, Candidate] = {
    "random": _fresh("random"),
    "(0,2), Owen, new keys": _fresh("(0,2), Owen"),
    "Z, new keys": _fresh("Z, hash"),
    "optimised orders, new keys": _fresh("optimised orders"),
    "Hilbert, new keys": _fresh("Hilbert, Owen-Sobol'"),
    "Hilbert, golden shifts": Candidate(_along(orders.hilbert, _golden)),
    "Hilbert, moving": Candidate(
        _along(orders.hilbert, lambda dims, key, frame: sequences.in_time(_owen(dims, key)).at_frame(frame))
    ),
    "dither mask, golden shifts": Candidate(
        lambda dims, width, height, spp, key, frame: _masked(dims, width, height, spp, key).at_frame(frame)
    ),
    "Z, moving": _moving(samplers.z),
    "optimised orders, moving": _moving(samplers.optimized),
    "designed frames": replace(_moving(samplers.designed), most_spp=_TILED),
}
"""Samplers for animations. A new frame does not recompile."""

PROGRESSIVE: dict[str, Candidate] = {
    **{name: CANDIDATES[name] for name in ("random", "(0,2), Owen")},
    "pmj02": Candidate(
        lambda dims, width, height, spp, key: samplers.independent(sequences.pmj02(spp, key), key),
        most_dims=2,
    ),
    **{name: CANDIDATES[name] for name in ("ranked keys", "dither mask", "Z, hash", "optimised orders")},
    "progressive orders": Candidate(
        lambda dims, width, height, spp, key: samplers.progressive(width, height, key, dims)
    ),
    "designed, progressive": Candidate(
        lambda dims, width, height, spp, key: samplers.designed(
            width, height, spp, key, dims, progressive=True
        ),
        powers_of_two=True,
        most_spp=_TILED,
    ),
}
"""Samplers for images that are shown while they are rendered.

Blocks along a curve are excluded: the first samples of all pixels share an interval of length 1 / spp.
"""
