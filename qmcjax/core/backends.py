"""Sizes of work for a device: the only dependence of programs on the backend.

On a CPU, caches hold a few thousand numbers and threads start immediately: loops over small tiles are fast. A
GPU runs a hundred thousand threads, and launching a kernel takes as long as millions of samples: a few large
kernels are fast, with threads that share the samples of a pixel.
"""

from typing import NamedTuple

from qmcjax.core import devices


class Backend(NamedTuple):
    """Sizes for one kind of device."""

    lanes: int
    """Numbers in an array for a tile of an image: pixels times the samples along an axis."""
    together: int
    """Samples, or batches of them, of a pixel along an axis."""
    coordinates: int | None
    """Coordinates of the samples that one thread evaluates; None: as the sampler specifies."""
    samples: int
    """Samples per call of a program: progress is reported between calls."""
    pixels: int
    """Pixels per call; their sums are held in memory."""
    listed: tuple[int, ...]
    """Pixels per call in lists of them: few sizes mean few programs."""
    listed_traced: tuple[int, int]
    """The same for a ray-traced scene, which is compiled once; the smaller one is for small images."""
    rows: int
    """Points of a sequence that are evaluated together."""
    pairs: int
    """Numbers in an array of pairs of points."""
    caches: bool
    """Whether it is a CPU: tiles stay in caches, Numba programs run, new memory is slow."""


CPU = Backend(
    lanes=2**14,  # sums and states stay in a second-level cache
    together=1,
    coordinates=None,
    samples=2**26,
    pixels=2**22,
    listed=(16384, 4096, 1024, 256),
    # Smaller calls take longer, larger ones discard more of the last call.
    listed_traced=(4096, 1024),
    rows=4096,
    pairs=1,
    caches=True,
)

GPU = Backend(
    lanes=2**22,  # 16 MB: sums of batches stay in a second-level cache
    together=16,
    coordinates=16,  # with more, threads run out of registers
    samples=2**31,
    pixels=2**26,
    listed=(2**20, 2**15),
    listed_traced=(2**18, 2**14),
    rows=2**20,
    pairs=2**24,
    caches=False,
)
"""Measured on an NVIDIA H100."""

BY_PLATFORM = {"cpu": CPU}
"""Tests change this to run programs for other devices on a CPU."""


def current() -> Backend:
    """Return the sizes for the default device."""
    return BY_PLATFORM.get(devices.platform(), GPU)
