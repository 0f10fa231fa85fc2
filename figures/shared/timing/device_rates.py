"""Rates on a GPU beside this machine's processor and the bound of an H100, and differences of bits.

In a process of its own, which sees all devices.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures.shared.timing.h100 import H100, Program, programs
from figures.shared.timing.operations import operations
from figures.shared.turns import typical

FAST = (2**25, 2048, 64)
"""Points, side of images, samples per pixel where a GPU is timed: a thousand times what it does at once."""

SLOW = (2**22, 512, 64)
"""The same where a processor is timed, and where both must agree."""

LEAST = {"draft": 0.05, "paper": 0.5}
"""Seconds that a program is timed for."""

AT_ONCE = 8
"""Calls in a row, so that a GPU does not wait for the next one."""

NUMBERS = 2**20
"""Numbers that each operation is tried with."""

Operation = tuple[Callable[..., Any], tuple[str, ...]]
"""A function, and what its arguments are drawn from."""

OPERATIONS: dict[str, Operation] = {
    "add": (jnp.add, ("real", "real")),
    "subtract": (jnp.subtract, ("real", "real")),
    "multiply": (jnp.multiply, ("real", "real")),
    "divide": (jnp.divide, ("real", "real")),
    "sqrt": (jnp.sqrt, ("positive",)),
    "rsqrt": (jax.lax.rsqrt, ("positive",)),
    "exponential": (jnp.exp, ("angle",)),
    "log": (jnp.log, ("positive",)),
    "power": (jnp.power, ("positive", "unit")),
    "sine": (jnp.sin, ("angle",)),
    "cosine": (jnp.cos, ("angle",)),
    "tan": (jnp.tan, ("unit",)),
    "tanh": (jnp.tanh, ("angle",)),
    "atan2": (jnp.arctan2, ("real", "real")),
    "floor": (jnp.floor, ("real",)),
    "ceil": (jnp.ceil, ("real",)),
    "round-nearest-even": (jnp.round, ("real",)),
    "abs": (jnp.abs, ("real",)),
    "negate": (jnp.negative, ("real",)),
    "sign": (jnp.sign, ("real",)),
    "minimum": (jnp.minimum, ("real", "real")),
    "maximum": (jnp.maximum, ("real", "real")),
    "clamp": (lambda x: jnp.clip(x, 0, 1), ("real",)),
    "convert": (lambda x: x.astype(jnp.float32), ("word",)),
    "compare": (lambda x, y: (x < y).astype(jnp.float32), ("real", "real")),
    "select": (lambda x, y: jnp.where(x < 0, y, x), ("real", "real")),
    "is-finite": (lambda x: jnp.isfinite(x).astype(jnp.float32), ("real",)),
}
"""All that our programs do with floats, by the names that XLA has for it."""


class Row(NamedTuple):
    """What was found about a program."""

    rate: float
    """Samples per second on the device."""
    bound: float
    """What an H100 can reach at most."""
    processor: float
    """Samples per second on the processor."""
    ulps: int
    """Largest difference between both in units in the last place."""
    exact: bool
    """Whether there must be none: points are made of integers until the last step."""


def measured(quality: str) -> dict[str, Any]:
    """Return the rates of programs and differences of operations, both by name; nothing without a GPU."""
    found = [device for device in jax.devices() if device.platform != "cpu"]
    if not found:
        return {}
    device, cpu = found[0], jax.devices("cpu")[0]
    return {
        "device": device.device_kind,
        "programs": {
            name: compared(name, device, cpu, FAST, SLOW, LEAST[quality])._asdict()
            for name in programs(*SLOW)
        },
        "units in the last place of one operation": {
            name: differing(name, device, cpu) for name in OPERATIONS
        },
    }


Sizes = tuple[int, int, int]


def compared(name: str, device: Any, other: Any, fast: Sizes, slow: Sizes, least: float) -> Row:
    """Time a program on two devices, and compare what they make of the same arguments."""
    rate, _ = _measured(name, device, fast, least)
    _, here = _measured(name, device, slow, least)
    other_rate, there = _measured(name, other, slow, least)
    with jax.default_device(other):
        program = programs(*slow)[name]()
        compiled = program.compiled()
        # What a program moves within itself may stay in a cache.
        memory = compiled.memory_analysis()
        moved = memory.argument_size_in_bytes + memory.output_size_in_bytes
        busy = H100.seconds(operations(compiled)._replace(bytes=moved))
    return Row(rate, program.samples / max(busy.values()), other_rate, ulps(here, there), program.exact)


def _measured(name: str, device: Any, sizes: Sizes, least: float) -> tuple[float, NDArray]:
    """Return samples a second, and those of the first call."""
    with jax.default_device(device):
        program: Program = programs(*sizes)[name]()
        arguments = jax.device_put(program.arguments, device)
        run = jax.jit(program.run)
        first = np.asarray(run(jnp.uint32(0), *arguments))

        def calls(turn: int) -> None:
            # Another start each time.
            made = [run(jnp.uint32((turn * AT_ONCE + k) * 2), *arguments) for k in range(AT_ONCE)]
            jax.block_until_ready(made)

        return AT_ONCE * program.samples / seconds(calls, least), first


def seconds(call: Callable[[int], object], least: float) -> float:
    """Return the median time of a call, over at least three and so many seconds, after one."""
    call(0)
    return typical(lambda turn: call(1 + turn), 3, least)


def ulps(one: NDArray, other: NDArray) -> int:
    """Return by how many units in the last place arrays of float32 differ, at most."""
    words = [np.asarray(a, np.float32).view(np.int32).astype(np.int64) for a in (one, other)]
    # In the order of the floats; both zeros are 0.
    ordered = [np.where(word < 0, -(word + 2**31), word) for word in words]
    both = np.isnan(one) & np.isnan(other)
    return int(np.max(np.where(both, 0, np.abs(ordered[0] - ordered[1])), initial=0))


def differing(name: str, device: Any, other: Any) -> int:
    """Return by how many units in the last place two devices differ in one operation, at most."""
    function, kinds = OPERATIONS[name]
    rng = np.random.default_rng(1)
    arguments = [_drawn(rng, kind) for kind in kinds]
    here, there = (
        np.asarray(jax.jit(function)(*(jax.device_put(a, place) for a in arguments)))
        for place in (device, other)
    )
    return ulps(here, there)


def _drawn(rng: np.random.Generator, kind: str) -> NDArray:
    """Return numbers of all magnitudes that programs meet, none of them denormal: GPUs may flush those."""
    if kind == "word":
        return rng.integers(2**32, size=NUMBERS, dtype=np.uint32)
    if kind == "unit":
        return rng.random(NUMBERS, np.float32)
    if kind == "angle":
        return rng.uniform(-20, 20, NUMBERS).astype(np.float32)
    size = np.exp2(rng.uniform(-30, 30, NUMBERS))
    sign = 1 if kind == "positive" else rng.choice([-1, 1], NUMBERS)
    return (sign * size).astype(np.float32)
