"""Coordinates per second, ours and peers', in a separate process: its peak of memory is read.

Medians of several calls, each for other points, after others that are not counted.
"""

import contextlib
import sys
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from figures.shared.costs import in_turns, peak_of
from qmcjax import integrate, sequences

CALLS, COUNTED = 40, 7
"""How many calls are made at most, and how many of them, the last ones, are counted."""

BUDGET = {"draft": 0.05, "paper": 3.0}
"""Seconds after which no further call is made."""

Draw = Callable[[int], object]
"""Makes block number i of some points."""


class Case(NamedTuple):
    """One amount of points, made by us in some ways and by peers."""

    title: str
    coordinates: int
    ours: dict[str, Draw]
    peers: dict[str, Draw]


def ours(sequence: sequences.Sequence, n: int, repeat: bool = False) -> dict[str, Draw]:
    """Return the drawing of blocks of n points that are kept, float32 and float64; or of the first, again."""

    def draw(dtype: type) -> Draw:
        return lambda i: jax.block_until_ready(sequence.points(n, 0 if repeat else i * n, dtype=dtype))

    return {"float32": draw(jnp.float32), "float64": draw(jnp.float64)}


def consume(sequence: sequences.Sequence, n: int) -> dict[str, Draw]:
    """Return the mean of blocks of n points in one program that keeps no points."""

    def draw(dtype: type) -> Draw:
        return lambda i: jax.block_until_ready(integrate(_itself, sequence, n, i * n, dtype=dtype))

    return {"float32": draw(jnp.float32), "float64": draw(jnp.float64)}


def _itself(points: jax.Array) -> jax.Array:
    return points


def scipy_engine(name: str, dims: int, n: int, **options: object) -> dict[str, Draw]:
    """Return scipy's engine, drawing one block after the other."""
    from scipy.stats import qmc

    engine = getattr(qmc, name)(dims, **options)
    return {"scipy": lambda i: engine.random(n)}


def qmcpy_net(name: str, dims: int, n: int, **options: object) -> dict[str, Draw]:
    """Return a discrete distribution of QMCPy's, if it is installed."""
    with contextlib.suppress(ImportError):
        import qmcpy  # pyright: ignore[reportMissingImports]

        net = getattr(qmcpy, name)(dims, **options)
        # It takes no other start than 0 or a power of 2: the same points each time.
        return {"QMCPy": lambda i: net.gen_samples(n, warn=False)}
    return {}


def torch_engine(dims: int, n: int, scramble: bool) -> dict[str, Draw]:
    """Return torch's Sobol' engine, if it is installed, drawing one block after the other."""
    with contextlib.suppress(ImportError):
        import torch  # pyright: ignore[reportMissingImports]

        engine = torch.quasirandom.SobolEngine(dims, scramble=scramble, seed=1)
        return {"torch": lambda i: engine.draw(n, dtype=torch.float64)}
    return {}


def average(peers: dict[str, Draw]) -> dict[str, Draw]:
    """Return the peers with the mean taken of what they draw."""

    def mean(draw: Draw) -> Draw:
        return lambda i: np.asarray(draw(i)).mean(axis=0)

    return {name: mean(draw) for name, draw in peers.items()}


def cases(quality: str) -> list[Case]:
    """Return what is measured, smaller and so less telling in drafts."""
    shrink = 0 if quality == "paper" else 8
    listed = []
    for dims, n in ((2, 2 ** (22 - shrink)), (32, 2 ** (20 - shrink))):
        sobol = sequences.sobol(dims)
        plain = (
            scipy_engine("Sobol", dims, n, scramble=False)
            | qmcpy_net("DigitalNetB2", dims, n, randomize=False)
            | torch_engine(dims, n, False)
        )
        scrambled = (
            scipy_engine("Sobol", dims, n, scramble=True, rng=1)
            | qmcpy_net("DigitalNetB2", dims, n, randomize="LMS DS", seed=1)
            | torch_engine(dims, n, True)
        )
        owen = sequences.owen(sobol, key=1)
        size = f"{n} x {dims}"
        listed += [
            Case(f"Sobol' {size}", n * dims, ours(sobol, n), plain),
            Case(f"Sobol' {size}, Owen (peers: linear) scrambled", n * dims, ours(owen, n), scrambled),
            Case(f"mean of Sobol' {size}", n * dims, consume(sobol, n), average(plain)),
            Case(
                f"mean of Sobol' {size}, Owen (peers: linear) scrambled",
                n * dims,
                consume(owen, n),
                average(scrambled),
            ),
        ]
    n, dims = 2 ** (20 - shrink), 16
    halton = scipy_engine("Halton", dims, n, scramble=False) | qmcpy_net("Halton", dims, n, randomize=False)
    listed += [
        Case(f"Halton {n} x {dims}", n * dims, ours(sequences.halton(dims), n), halton),
        Case(
            f"lattice {n} x {dims}",
            n * dims,
            ours(sequences.lattice(dims), n),
            qmcpy_net("Lattice", dims, n, randomize=False),
        ),
    ]
    n = 2 ** (20 - shrink)
    m = n.bit_length() - 1
    listed += [
        Case(f"{title} {n} x {sequence.dims}", n * sequence.dims, ours(sequence, n, repeat=True), {})
        for title, sequence in (
            ("Faure", sequences.faure(3)),
            ("permutation net", sequences.permutation_net(m)),
            ("rank-1 lattice", sequences.rank1_lattice(n)),
        )
    ]
    n = 2 ** (14 - shrink)
    exact = sequences.owen_exact(sequences.sobol(2), key=1)
    nested = qmcpy_net("DigitalNetB2", 2, n, randomize="NUS", seed=1)
    return [*listed, Case(f"exact Owen {n} x 2", n * 2, ours(exact, n), nested)]


def seconds(draw: Draw, budget: float) -> list[float]:
    """Return how long the last calls take, of as many as fit into so many seconds.

    The first one compiles. After it memory may be slow for some more: where a virtual machine hands pages
    that were free for a few seconds back to its host (free page reporting), their next touch takes twenty
    times as long, 95 ms instead of 4 for 32 MB of large pages, whichever program touches them. Calls that
    follow each other at once come to use the same pages again.
    """
    return [seconds.clock for seconds in in_turns({"": draw}, CALLS, budget)[""][1:]][-COUNTED:]


def memory(dtype: type) -> float | None:
    """Return by how many times its result ``points`` raises the memory in use, at most (Linux only)."""
    sequence = sequences.owen(sequences.sobol(32), key=1)
    jax.block_until_ready(sequence.points(2**16, dtype=dtype))  # the memory that programs and tables take
    peak = peak_of(lambda n: sequence.points(n, dtype=dtype), 2**21)
    return peak and peak / (2**21 * 32 * np.dtype(dtype).itemsize)


def measure(quality: str) -> dict[str, Any]:
    """Return rates by case, and memory by the type of points."""
    warnings.simplefilter("ignore")
    linux = sys.platform == "linux"
    peak = {np.dtype(dtype).name: memory(dtype) for dtype in (jnp.float32, jnp.float64) if linux}
    found = []
    for case in cases(quality):
        entry: dict[str, object] = {"case": case.title}
        for who, draws in (("ours", case.ours), ("peers", case.peers)):
            times = {name: seconds(draw, BUDGET[quality]) for name, draw in draws.items()}
            entry[who] = {name: case.coordinates / float(np.median(each)) for name, each in times.items()}
        found.append(entry)
    return {"cases": found, "peak memory / output": peak}
