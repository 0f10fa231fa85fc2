"""What a GPU makes of our programs: ``qmcjax gpu``."""

import contextlib
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from figures._options import command
from figures.shared.timing.h100 import H100, Program, programs
from figures.shared.timing.operations import operations
from figures.shared.turns import typical

FAST = (2**25, 2048, 64)
"""Points, side of images, samples per pixel where a GPU is timed: a thousand times what it does at once."""

SLOW = (2**22, 512, 64)
"""The same where a processor is timed, and where both must agree."""

LEAST = 0.5
"""Seconds that a program is timed for."""

AT_ONCE = 8
"""Calls in a row, so that a GPU does not wait for the next one."""

NUMBERS = 2**20
"""Numbers that each operation is tried with."""

MOST = 1
"""Units in the last place by which two processors may differ in one operation."""

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

    name: str
    rate: float
    """Samples a second on the device."""
    bound: float
    """What an H100 could make of it, at most."""
    other: float
    """Samples a second on the processor."""
    ulps: int
    """By how many units in the last place both differ, at most."""
    exact: bool
    """Whether they must not."""


def main(argv: Sequence[str]) -> int:
    """Measure a GPU; return 1 if there is none, or if it computes something else than the processor."""
    command(
        "gpu",
        "Samples a second on a GPU, against the most that an H100 could make, this machine's "
        "processor and torch's SobolEngine; and whether the GPU computes the same as the processor.",
    ).parse_args(argv)
    found = [device for device in jax.devices() if device.platform != "cpu"]
    if not found:
        print(
            f"no GPU: JAX {jax.__version__} sees only {jax.devices()[0].device_kind} devices here. Nothing "
            "was measured (pip install 'jax[cuda12]' for one of NVIDIA's).",
            file=sys.stderr,
        )
        return 1
    device, cpu = found[0], jax.devices("cpu")[0]
    print(f"{device.device_kind}, against {H100.name}'s bound and this machine's processor")
    print(f"{'':30}{'samples/s':>10}{'bound':>10}{'part':>7}{'CPU':>10}{'times':>8}  bits")
    same = True
    for name in programs(*SLOW):
        row = compared(name, device, cpu, FAST, SLOW)
        print(_line(row), flush=True)
        # A value of a scene that rounds to the other side of an edge is another one.
        same &= row.ulps == 0 or not row.exact
    for title, rate in torch_rates(FAST[0], str(device.platform)).items():
        print(f"{title:30}{rate:10.2e}")
    off = {name: differing(name, device, cpu) for name in OPERATIONS}
    print("units in the last place between both, of one operation:")
    print("  " + ", ".join(f"{name} {ulps}" for name, ulps in off.items()))
    beyond = [name for name, ulps in off.items() if ulps > MOST]
    if beyond:
        print(f"more than {MOST}: {', '.join(beyond)}", file=sys.stderr)
    if not same:
        print("points differ from those of the processor", file=sys.stderr)
    return 0 if same and not beyond else 1


def _line(row: Row) -> str:
    bits = "the same" if not row.ulps else f"off by up to {row.ulps} ulp"
    part, times = row.rate / row.bound, row.rate / row.other
    return f"{row.name:30}{row.rate:10.2e}{row.bound:10.2e}{part:7.1%}{row.other:10.2e}{times:8.0f}  {bits}"


Sizes = tuple[int, int, int]


def compared(name: str, device: Any, other: Any, fast: Sizes, slow: Sizes) -> Row:
    """Time a program on two devices, and compare what they make of the same arguments."""
    rate, _ = _measured(name, device, fast)
    _, here = _measured(name, device, slow)
    other_rate, there = _measured(name, other, slow)
    with jax.default_device(other):
        program = programs(*slow)[name]()
        busy = H100.seconds(operations(program.compiled()))
    bound = program.samples / max(busy.values())
    return Row(name, rate, bound, other_rate, ulps(here, there), program.exact)


def _measured(name: str, device: Any, sizes: Sizes) -> tuple[float, NDArray]:
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

        return AT_ONCE * program.samples / seconds(calls), first


def seconds(call: Callable[[int], object]) -> float:
    """Return the median time of a call, over at least three and so many seconds, after one."""
    call(0)
    return typical(lambda turn: call(1 + turn), 3, LEAST)


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


def torch_rates(n: int, device: str) -> dict[str, float]:
    """Return points a second of torch's Sobol' engine, which draws on the processor, if it is installed."""
    rates = {}
    with contextlib.suppress(ImportError):
        import torch  # pyright: ignore[reportMissingImports]

        for title, scramble in (("torch, Sobol', 2-D", False), ("torch, Sobol', 2-D, linear", True)):
            engine = torch.quasirandom.SobolEngine(2, scramble=scramble, seed=1)
            engine.draw(n)
            rates[title] = n / seconds(lambda _, engine=engine: engine.draw(n) and None)
            if device == "gpu" and torch.cuda.is_available():

                def moved(_: int, engine: Any = engine) -> None:
                    engine.draw(n).to("cuda")
                    torch.cuda.synchronize()

                rates[f"{title}, on the GPU"] = n / seconds(moved)
    return rates
