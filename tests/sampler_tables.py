"""A maker of each kind of sampler, and what several tests of samplers compare with."""

import numpy as np

from analysis import error_spectrum, radial_average
from qmcjax import orders, samplers, sequences


def owen(dims, key=1):
    return sequences.owen(sequences.sobol(dims), key)


def moved(dims, key, of=sequences.lattice):
    return sequences.rotate(of(dims), key)


def shifted(dims, key):
    return sequences.digital_shift(sequences.sobol(dims), key)


def hilbert(side):
    return orders.hilbert(side, side)


def tile(*shape):
    return np.random.default_rng(1).random(shape)


contiguous, partitioned, halton = samplers.contiguous, samplers.partitioned, sequences.halton
# Arguments are the side, samples, dimensions and a key; not all use all of them.
MAKERS = {
    "independent": lambda w, n, d, key: samplers.independent(sequences.sobol(d), key),
    "independent, xor": lambda w, n, d, key: samplers.independent(sequences.sobol(d), key, "xor"),
    "independent, shift": lambda w, n, d, key: samplers.independent(
        sequences.components(sequences.halton(d), tuple(range(d))), key, "shift"
    ),
    "full_screen": lambda w, n, d, key: samplers.full_screen(shifted(d, key), w, w),
    "full_screen, halton": lambda w, n, d, k: samplers.full_screen(sequences.halton(d, "random", k), w, w),
    "padded_replications": lambda w, n, d, key: samplers.padded_replications(shifted(d, key), w, w, key),
    "contiguous": lambda w, n, d, key: samplers.contiguous(hilbert(w), owen(d, key), n),
    "contiguous, halton": lambda w, n, d, key: samplers.contiguous(hilbert(w), sequences.halton(d), n),
    "contiguous, two words": lambda w, n, d, key: samplers.contiguous(hilbert(w), owen(d, key), 2**30),
    "contiguous, frames": lambda w, n, d, k: contiguous(orders.hilbert3(w, w, 4), owen(d, k), n).at_frame(3),
    "segments": lambda w, n, d, key: samplers.segments(hilbert(w), owen(d, key), n, True),
    "segments, lattice": lambda w, n, d, key: samplers.segments(hilbert(w), moved(d, key), n),
    "partitioned": lambda w, n, d, key: samplers.partitioned(hilbert(w), owen(d + 1, key)),
    "partitioned, exact": lambda w, n, d, key: partitioned(hilbert(w), sequences.sobol(d + 1), exact=True),
    "shifted": lambda w, n, d, key: samplers.shifted(hilbert(w), moved(d, key, halton), sequences.lattice(d)),
    "dither": lambda w, n, d, key: samplers.dither(samplers.blue_noise_mask(2), moved(d, key)),
    "window_lattice": lambda w, n, d, key: samplers.window_lattice(sequences.sobol(d), key),
    "interleaved": lambda w, n, d, key: samplers.interleaved(owen(d, key), n, tile=4),
    "ranked": lambda w, n, d, key: samplers.ranked(d, key),
    "randomized": lambda w, n, d, key: samplers.randomized(
        lambda each: samplers.contiguous(hilbert(w), owen(d, each), min(n, 2)), key
    ),
    "optimized": lambda w, n, d, key: samplers.optimized(w, w, n, key, d),
    "optimized, frames": lambda w, n, d, key: samplers.optimized(w, w, n, key, d, frames=8).at_frame(5),
    "progressive": lambda w, n, d, key: samplers.progressive(w, w, key, d),
    "designed": lambda w, n, d, key: samplers.designed(w, w, n, key, d),
    "designed, progressive": lambda w, n, d, key: samplers.designed(w, w, n, key, d, progressive=True),
    "designed, frames": lambda w, n, d, key: samplers.designed(w, w, n, key, d, 8).at_frame(5),
    "tiled": lambda w, n, d, key: samplers.tiled(tile(8, 4, 2, 2), key, dims=d, spp=n),
    "z": lambda w, n, d, key: samplers.z(w, w, n, key, dims=d),
    "z, tree": lambda w, n, d, key: samplers.z(w, w, n, key, "tree", dims=d),
    "z, joint": lambda w, n, d, key: samplers.z(w, w, n, key, sequence=owen(d, key)),
    "z, rounds": lambda w, n, d, key: samplers.z(w, w, n, key, dims=d).extended(2),
    "z, counts": lambda w, n, d, key: samplers.z(w, w, n, key, dims=d).adaptive(np.full((w, w), n)),
    "z, frames": lambda w, n, d, key: samplers.z(w, w, n, key, dims=d, frames=8).at_frame(5),
}


def low_power(errors):
    """Return the mean radial power of an image below 1/16 of a cycle per pixel, 1 for white noise."""
    frequency, power = radial_average(error_spectrum(errors, np.zeros_like(errors)))
    return power[frequency < len(errors) / 16].mean()
