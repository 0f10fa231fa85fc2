"""Nanoseconds per coordinate on one core, in a process of its own, which stays there."""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from figures import _cpp
from figures.making import openqmc
from figures.shared.turns import in_turns
from qmcjax import bridges, orders, samplers, sequences

DIMS = (0, 1, 2, 3)
BLOCK = 2**16
"""Samples of a call of XLA's program, about."""


class Size(NamedTuple):
    """How much is measured."""

    side: int
    spp: int
    turns: int
    plain: int
    """Side of the pixels in plain Python."""


SIZES = {"draft": Size(64, 4, 3, 16), "paper": Size(64, 16, 60, 16)}

C, XLA, PLAIN, OPENQMC = "C from source", "XLA, one thread", "PlainSampler", "OpenQMC"
SINGLE = ", one sample per pixel"
"""Ending of the ways of images with one sample per pixel."""

OWEN, LATTICE, DITHERED = "Sobol', Owen per pixel", "lattice, shifted per pixel", "lattice, dithered"
TILE = "tile designed by gradients"

EQUAL = {
    "sobol": (OWEN,),
    "pmj": (OWEN,),
    "lattice": (LATTICE,),
    "sobolbn": ("optimised orders", "Z", "ranked keys", "Owen along Hilbert", TILE),
    "pmjbn": ("optimised orders", "Z", "ranked keys", "Owen along Hilbert", TILE),
    "latticebn": (DITHERED, TILE),
}
"""Samplers of OpenQMC, and those of ours with the same features or more: how the points of a pixel are
distributed and randomised, and whether errors of neighbouring pixels cancel."""

ROWS = """
#if defined(__GNUC__)
__attribute__((noinline))
#endif
static void row(uint32_t y, uint32_t width, uint32_t spp, float *points) {
    if (spp == 1) {
        for (uint32_t x = 0; x < width; x++) mine(x, y, 0, mine_seeds, points + 4 * x);
        return;
    }
    for (uint32_t x = 0; x < width; x++) {
        const mine_pixel pixel = mine_prepare(x, y, mine_seeds);
        for (uint32_t s = 0; s < spp; s++, points += 4) mine_sample(pixel, s, mine_seeds, points);
    }
}

void image(uint32_t width, uint32_t height, uint32_t spp, float *points) {
    for (uint32_t y = 0; y < height; y++) {
        row(y, width, spp, points);
        __asm__ volatile("" : : : "memory");
    }
}
"""
"""All samples of the pixels of an image, row by row: the samples of the next row overwrite them.

Compilers make vector code of the inner loop: over samples, or over pixels if they have one sample each.
"""


def ours(side: int, spp: int) -> dict[str, samplers.Sampler]:
    """Return samplers of four dimensions."""
    owen = sequences.owen(sequences.sobol(4), key=1)
    mask = samplers.blue_noise_mask(2)
    return {
        OWEN: samplers.independent(sequences.sobol(4), key=1),
        LATTICE: samplers.independent(sequences.lattice(4), key=1, randomize="shift"),
        "Owen along Hilbert": samplers.contiguous(orders.hilbert(side, side), owen, spp),
        "Z": samplers.z(side, side, spp, key=1, dims=4),
        "optimised orders": samplers.optimized(side, side, spp, key=1, dims=4),
        "ranked keys": samplers.ranked(4, key=1),
        TILE: samplers.designed(side, side, spp, key=1, dims=4),
        DITHERED: samplers.dither(mask, sequences.lattice(4)),
    }


Call = Callable[[Any], Any]


def in_c(function: Any, size: Size) -> Call:
    """Return the image of a compiled function."""
    points = np.empty((size.side, size.spp, len(DIMS)), np.float32)
    where = points.ctypes.data_as(_cpp.ctypes.c_void_p)

    def call(turn: Any) -> Any:
        del turn
        function(size.side, size.side, size.spp, where)
        return points

    return call


def by_xla(sampler: samplers.Sampler, size: Size) -> Call:
    """Return the image in blocks of rows: a program for a pixel's samples, of what the pixel prepares."""
    rows = max(1, min(size.side, BLOCK // (size.side * size.spp)))

    @jax.jit
    def block(sampler: samplers.Sampler, first: jax.Array) -> jax.Array:
        x = jnp.broadcast_to(jnp.arange(size.side, dtype=jnp.uint32), (rows, size.side))
        y = jnp.broadcast_to(first + jnp.arange(rows, dtype=jnp.uint32)[:, None], x.shape)
        state = sampler.prepare(x, y, DIMS)
        count = jnp.arange(size.spp, dtype=jnp.uint32)
        return jax.lax.map(lambda s: sampler.points(state, s, DIMS, jnp.float32), count)

    def call(turn: Any) -> Any:
        del turn
        made = None
        for first in range(0, size.side, rows):
            made = jax.block_until_ready(block(sampler, np.uint32(first)))
        return made

    return call


def in_python(sampler: samplers.Sampler, size: Size) -> Call:
    """Return some of the image, one number after the other."""
    plain = bridges.PlainSampler(sampler)

    def call(turn: Any) -> Any:
        del turn
        last = None
        for y in range(size.plain):
            for x in range(size.plain):
                for s in range(size.spp):
                    plain.start((x, y), s)
                    plain.get2d()
                    last = plain.get2d()
        return last

    return call


def measured(quality: str) -> dict[str, dict[str, float]]:
    """Return nanoseconds by sampler and way."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    size = SIZES[quality]
    single, square = size._replace(spp=1), Size(size.plain, size.spp, 0, 0)
    sizes = {C: size, XLA: size, PLAIN: square, OPENQMC: size, C + SINGLE: single, OPENQMC + SINGLE: single}
    calls: dict[tuple[str, str], Call] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, (title, sampler) in enumerate(ours(size.side, size.spp).items()):
            text = bridges.source(sampler, DIMS, "c", width=size.side, height=size.side, spp=size.spp)
            library = _cpp.library_of(f"{text}{ROWS}", folder, f"ours{number}")
            if library is not None:
                calls |= {(title, C + end): in_c(library.image, sizes[C + end]) for end in ("", SINGLE)}
            calls[title, XLA] = by_xla(sampler, size)
            calls[title, PLAIN] = in_python(sampler, size)
        checkout = openqmc.path()
        theirs = None if checkout is None else _cpp.openqmc(checkout, folder)
        if theirs is not None:
            ways = (OPENQMC, OPENQMC + SINGLE)
            calls |= {(name, way): in_c(getattr(theirs, name), sizes[way]) for name in EQUAL for way in ways}
        named = {"\n".join(key): call for key, call in calls.items()}
        taken = in_turns(named, size.turns)
    found: dict[str, dict[str, float]] = {}
    for key, times in taken.items():
        title, way = key.split("\n")
        # The least of a core that other programs use, too.
        least = min(seconds.clock for seconds in times[1:])
        coordinates = sizes[way].side ** 2 * sizes[way].spp * len(DIMS)
        found.setdefault(title, {})[way] = 1e9 * least / coordinates
    return found
