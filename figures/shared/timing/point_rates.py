"""Coordinates per second, ours and peers', in a separate process: its peak of memory is read.

Medians of several calls, each for other points, after others that are not counted.
"""

import sys
import warnings
from collections.abc import Callable
from importlib.util import find_spec
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

Draws = dict[str, Callable[[int], object]]
"""By name: what makes block number i of some points."""


class Case(NamedTuple):
    """One amount of points, made by us in some ways and by peers."""

    title: str
    coordinates: int
    ours: Draws
    peers: Draws


def ours(sequence: sequences.Sequence, n: int, repeat: bool = False, mean: bool = False) -> Draws:
    """Return the drawing of blocks of n points in both precisions; of the first again, or of means only."""

    def draw(dtype: type) -> Callable[[int], object]:
        def points(i: int) -> Any:
            first = 0 if repeat else i * n
            if mean:  # in one program that keeps no points
                return integrate(_itself, sequence, n, first, dtype=dtype)
            return sequence.points(n, first, dtype=dtype)

        return lambda i: jax.block_until_ready(points(i))

    return {"float32": draw(jnp.float32), "float64": draw(jnp.float64)}


def _itself(points: jax.Array) -> jax.Array:
    return points


def peers(
    dims: int, n: int, scipy: str = "", qmcpy: str = "", key: int | None = None, how: str = ""
) -> Draws:
    """Return what of scipy, QMCPy and torch is installed and has such points, plain or with a key.

    ``scipy``, ``qmcpy``: names of their classes. ``how``: QMCPy randomises. scipy and torch draw one block
    after the other; QMCPy takes no other start than 0 or a power of 2: it draws the same points each time.
    """
    found: Draws = {}
    if scipy:
        from scipy.stats import qmc

        engine = getattr(qmc, scipy)(dims, scramble=key is not None, rng=key)
        found["scipy"] = lambda i: engine.random(n)
    if qmcpy and find_spec("qmcpy"):
        import qmcpy as theirs  # pyright: ignore[reportMissingImports]

        net = getattr(theirs, qmcpy)(dims, randomize=how or False, **({} if key is None else {"seed": key}))
        found["QMCPy"] = lambda i: net.gen_samples(n, warn=False)
    if scipy == "Sobol" and find_spec("torch"):
        import torch  # pyright: ignore[reportMissingImports]

        sobol = torch.quasirandom.SobolEngine(dims, scramble=key is not None, seed=1)
        found["torch"] = lambda i: sobol.draw(n, dtype=torch.float64)
    return found


def cases(quality: str) -> list[Case]:
    """Return what is measured, smaller and so less telling in drafts."""
    shrink = 0 if quality == "paper" else 8
    listed = []
    for dims, n in ((2, 2 ** (22 - shrink)), (32, 2 ** (20 - shrink))):
        sobol = sequences.sobol(dims)
        plain = peers(dims, n, "Sobol", "DigitalNetB2")
        scrambled = peers(dims, n, "Sobol", "DigitalNetB2", 1, "LMS DS")
        for title, sequence, theirs in (
            (f"Sobol' {n} x {dims}", sobol, plain),
            (f"Sobol' {n} x {dims}, Owen (peers: linear) scrambled", sequences.owen(sobol, key=1), scrambled),
        ):
            means: Draws = {
                name: lambda i, draw=draw: np.asarray(draw(i)).mean(axis=0) for name, draw in theirs.items()
            }
            listed += [
                Case(title, n * dims, ours(sequence, n), theirs),
                Case(f"mean of {title}", n * dims, ours(sequence, n, mean=True), means),
            ]
    n, dims = 2 ** (20 - shrink), 16
    for title, sequence, theirs in (
        ("Halton", sequences.halton(dims), peers(dims, n, "Halton", "Halton")),
        ("lattice", sequences.lattice(dims), peers(dims, n, qmcpy="Lattice")),
    ):
        listed.append(Case(f"{title} {n} x {dims}", n * dims, ours(sequence, n), theirs))
    for title, sequence in (
        ("Faure", sequences.faure(3)),
        ("permutation net", sequences.permutation_net(n.bit_length() - 1)),
        ("rank-1 lattice", sequences.rank1_lattice(n)),
    ):
        drawn = ours(sequence, n, repeat=True)
        listed.append(Case(f"{title} {n} x {sequence.dims}", n * sequence.dims, drawn, {}))
    n = 2 ** (14 - shrink)
    exact = ours(sequences.owen_exact(sequences.sobol(2), key=1), n)
    return [
        *listed,
        Case(f"exact Owen {n} x 2", n * 2, exact, peers(2, n, qmcpy="DigitalNetB2", key=1, how="NUS")),
    ]


def memory(dtype: type) -> float | None:
    """Return by how many times its result ``points`` raises the memory in use, at most (Linux only)."""
    sequence = sequences.owen(sequences.sobol(32), key=1)
    jax.block_until_ready(sequence.points(2**16, dtype=dtype))  # the memory that programs and tables take
    peak = peak_of(lambda n: sequence.points(n, dtype=dtype), 2**21)
    return peak and peak / (2**21 * 32 * np.dtype(dtype).itemsize)


def measure(quality: str) -> dict[str, Any]:
    """Return rates by case, and memory by the type of points.

    Only the last calls are counted. The first one compiles, and after it memory may be slow for some more:
    where a virtual machine hands pages that were free for a few seconds back to its host (free page
    reporting), their next touch takes twenty times as long, 95 ms instead of 4 for 32 MB of large pages,
    whichever program touches them. Calls that follow each other at once come to use the same pages again.
    """
    warnings.simplefilter("ignore")

    def rate(case: Case, draw: Callable[[int], object]) -> float:
        taken = in_turns({"": draw}, CALLS, BUDGET[quality])[""][1:][-COUNTED:]
        return case.coordinates / float(np.median([seconds.clock for seconds in taken]))

    linux = sys.platform == "linux"
    return {
        "cases": [
            {
                "case": case.title,
                "ours": {name: rate(case, draw) for name, draw in case.ours.items()},
                "peers": {name: rate(case, draw) for name, draw in case.peers.items()},
            }
            for case in cases(quality)
        ],
        "peak memory / output": {
            np.dtype(dtype).name: memory(dtype) for dtype in (jnp.float32, jnp.float64) if linux
        },
    }
