"""Rates on a GPU beside this machine's processor and a bound of an H100, and differences of bits.

In a separate process, which sees all devices.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

import qmcjax as qj
from figures.shared.costs import typical
from qmcjax import orders, samplers, scenes, sequences

FAST = (2**25, 2048, 64)
"""Points, side of images, samples per pixel where a GPU is timed: a thousand times what it does at once."""

SLOW = (2**22, 512, 64)
"""The same where a processor is timed, and where both must agree."""

LEAST = {"draft": 0.05, "paper": 0.5}
"""Seconds that a program is timed for."""

AT_ONCE = 8
"""Calls in a row, so that a GPU does not wait for the next one."""

H100 = {"flops": 67e12, "bytes accessed": 3.35e12}
"""Operations and bytes a second of an NVIDIA H100 SXM, at most, as XLA names them. From the datasheet and the
architecture paper of 2022: operations on 32-bit integers are as fast as those on floats."""


class Program(NamedTuple):
    """Something that makes samples, as a function of the index of the first point, and of arrays."""

    run: Callable[..., Array]
    arguments: tuple[Any, ...]
    samples: int
    """Of one call."""
    exact: bool
    """Whether it makes points: integers until the last step, so that all devices make the same bits."""


class Row(NamedTuple):
    """What was found about a program."""

    rate: float
    """Samples per second on the device."""
    bound: float
    """What an H100 can reach at most: XLA counts the operations of a loop once, so that it is no less."""
    processor: float
    """Samples per second on the processor."""
    ulps: int
    """Largest difference between both in units in the last place."""
    exact: bool


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
    sobol = sequences.sobol
    kept = {
        "Sobol', 2-D": lambda: sobol(2),
        "Sobol', 2-D, Owen": lambda: sequences.owen(sobol(2), 1),
        "Sobol', 16-D, Owen": lambda: sequences.owen(sobol(16), 1),
        "permutation net": lambda: sequences.permutation_net(n.bit_length() - 1),
        "lattice, 2-D": lambda: sequences.lattice(2),
        "Halton, 2-D": lambda: sequences.halton(2),
        "Halton, 2-D, Owen": lambda: sequences.owen(sequences.halton(2), 1),
        "random, 2-D": lambda: sequences.uniform(2, 1),
    }
    images = {
        "checkerboard, Z": (scenes.checkerboard, lambda: samplers.z(side, side, spp, 1)),
        "zone plate, Z": (scenes.zone_plate, lambda: samplers.z(side, side, spp, 1)),
        "checkerboard, Hilbert, Owen": (
            scenes.checkerboard,
            lambda: samplers.contiguous(orders.hilbert(side, side), sequences.owen(sobol(2), 1), spp),
        ),
        "soft shadow, ranked": (scenes.soft_shadow, lambda: samplers.ranked(4, 1)),
    }
    return {name: lambda make=make: points(make(), n) for name, make in kept.items()} | {
        name: lambda scene=scene, sampler=sampler: image(scene(), sampler(), side, spp)
        for name, (scene, sampler) in images.items()
    }


def measure(quality: str) -> dict[str, Any]:
    """Return the rates of programs by name; nothing without a GPU."""
    found = [device for device in jax.devices() if device.platform != "cpu"]
    if not found:
        return {}
    cpu, least = jax.devices("cpu")[0], LEAST[quality]
    rows = {name: compare(name, found[0], cpu, FAST, SLOW, least)._asdict() for name in programs(*SLOW)}
    return {"device": found[0].device_kind, "programs": rows}


Sizes = tuple[int, int, int]


def compare(name: str, device: Any, other: Any, fast: Sizes, slow: Sizes, least: float) -> Row:
    """Time a program on two devices, and compare what they make of the same arguments."""
    rate, _ = _rate(name, device, fast, least)
    _, here = _rate(name, device, slow, least)
    other_rate, there = _rate(name, other, slow, least)
    with jax.default_device(other):
        program = programs(*slow)[name]()
        counts: Any = jax.jit(program.run).lower(jnp.uint32(0), *program.arguments).compile().cost_analysis()
    busy = max(counts[kind] / most for kind, most in H100.items())
    return Row(rate, program.samples / busy, other_rate, ulps(here, there), program.exact)


def _rate(name: str, device: Any, sizes: Sizes, least: float) -> tuple[float, NDArray]:
    """Return samples per second, and those of the first call."""
    with jax.default_device(device):
        program = programs(*sizes)[name]()
        arguments = jax.device_put(program.arguments, device)
        run = jax.jit(program.run)
        first = np.asarray(run(jnp.uint32(0), *arguments))

        def calls(turn: int) -> None:
            # Another start each time; the first calls are not timed.
            made = [run(jnp.uint32(((1 + turn) * AT_ONCE + k) * 2), *arguments) for k in range(AT_ONCE)]
            jax.block_until_ready(made)

        calls(-1)
        return AT_ONCE * program.samples / typical(calls, 3, least), first


def ulps(one: NDArray, other: NDArray) -> int:
    """Return by how many units in the last place arrays of float32 differ, at most."""
    words = [np.asarray(a, np.float32).view(np.int32).astype(np.int64) for a in (one, other)]
    # In the order of the floats; both zeros are 0.
    ordered = [np.where(word < 0, -(word + 2**31), word) for word in words]
    both = np.isnan(one) & np.isnan(other)
    return int(np.max(np.where(both, 0, np.abs(ordered[0] - ordered[1])), initial=0))
