"""What an NVIDIA H100 could do at most, and the programs that are held against it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

import qmcjax as qj
from figures.shared.timing.operations import Operations
from qmcjax import orders, samplers, scenes, sequences


class Device(NamedTuple):
    """The rates of an accelerator, at most."""

    name: str
    bandwidth: float
    """Bytes a second, of its memory."""
    clock: float
    """Of its multiprocessors, in 1/s."""
    multiprocessors: int
    rates: dict[str, int]
    """Operations per clock of one multiprocessor, by kinds, and ``issue``: of all kinds together."""

    def seconds(self, counts: Operations) -> dict[str, float]:
        """Return how long each part of it is busy, at least: the largest is a bound of the time."""
        each = {kind: getattr(counts, kind) for kind in self.rates if kind != "issue"} | {
            "issue": counts.total
        }
        busy = {kind: count / self.peak(kind) for kind, count in each.items()}
        return {"memory": counts.bytes / self.bandwidth} | busy

    def peak(self, kind: str) -> float:
        """Return operations a second of a kind."""
        return self.rates[kind] * self.multiprocessors * self.clock


H100 = Device(
    "NVIDIA H100 SXM",
    3.35e12,
    1.98e9,
    132,
    {"float32": 256, "float64": 128, "integer": 256, "special": 16, "issue": 256},
)
"""Memory: NVIDIA H100 Tensor Core GPU Datasheet, 3.35 TB/s; 132 multiprocessors at 1.98 GHz (NVIDIA H100
Tensor Core GPU Architecture, 2022, Table 3). Instructions per clock: NVIDIA CUDA C++ Programming Guide,
"Throughput of Native Arithmetic Instructions", compute capability 9.0; four warps of 32 threads are issued
per clock. An instruction does up to two operations: a multiplication and an addition, of floats (67 TFLOP/s,
as NVIDIA counts) or of integers; two logical operations; a shift and an addition. Integer instructions run
on the 64 units for integers and, as multiplications and additions, on 64 others."""


class Program(NamedTuple):
    """Something that makes samples, as a function of the index of the first point, and of arrays."""

    run: Callable[..., Array]
    arguments: tuple[Any, ...]
    samples: int
    """Of one call."""
    exact: bool
    """Whether it makes points: integers until the last step, so that all devices make the same bits."""

    def compiled(self) -> Any:
        """Return the program for the default device."""
        return jax.jit(self.run).lower(jnp.uint32(0), *self.arguments).compile()


def points(sequence: sequences.Sequence, n: int) -> Program:
    """Return the program that makes n points and keeps them."""

    def run(first: Array, sequence: sequences.Sequence) -> Array:
        return sequence(jax.lax.iota(jnp.uint32, n) + first)

    return Program(run, (sequence,), n, True)


def image(scene: Any, sampler: Any, side: int, spp: int) -> Program:
    """Return the program that renders an image."""

    def run(first: Array, scene: Any, sampler: Any) -> Array:
        del first
        return qj.render(scene, sampler, side, side, spp)

    return Program(run, (scene, sampler), side * side * spp, False)


def programs(n: int, side: int, spp: int) -> dict[str, Callable[[], Program]]:
    """Return what makes the programs, by their names: n points, images of side x side pixels."""

    def owen(sequence: sequences.BinarySequence) -> sequences.Sequence:
        return sequences.owen(sequence, 1)

    def z() -> samplers.Sampler:
        return samplers.z(side, side, spp, 1)

    def along() -> samplers.Sampler:
        return samplers.contiguous(orders.hilbert(side, side), owen(sequences.sobol(2)), spp)

    kept = {
        "Sobol', 2-D": lambda: sequences.sobol(2),
        "Sobol', 2-D, Owen": lambda: owen(sequences.sobol(2)),
        "Sobol', 16-D, Owen": lambda: owen(sequences.sobol(16)),
        "permutation net": lambda: sequences.permutation_net(n.bit_length() - 1),
        "lattice, 2-D": lambda: sequences.lattice(2),
        "Halton, 2-D": lambda: sequences.halton(2),
        "Halton, 2-D, Owen": lambda: sequences.owen(sequences.halton(2), 1),
        "random, 2-D": lambda: sequences.uniform(2, 1),
    }
    seen = {
        "checkerboard, Z": (scenes.checkerboard, z),
        "zone plate, Z": (scenes.zone_plate, z),
        "checkerboard, Hilbert, Owen": (scenes.checkerboard, along),
        "soft shadow, ranked": (scenes.soft_shadow, lambda: samplers.ranked(4, 1)),
    }
    return {name: lambda make=make: points(make(), n) for name, make in kept.items()} | {
        name: lambda scene=scene, sampler=sampler: image(scene(), sampler(), side, spp)
        for name, (scene, sampler) in seen.items()
    }
