"""Entries of other projects, by their own code: Mitsuba, SciPy, QMCPy, torch.

Sequences have no place in an image: each pixel is a replicate, scrambled by a seed of its own.
"""

import importlib.metadata
import warnings
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from figures.suite.entries import Entry, NotSupportedError

MITSUBA = "mitsuba-"
"""Names of entries begin so."""

MITSUBAS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")

SCIPYS = {"scipy-sobol": "Sobol", "scipy-halton": "Halton", "scipy-latin": "LatinHypercube"}

QMCPYS = {
    "qmcpy-sobol": ("DigitalNetB2", "LMS_DS"),
    "qmcpy-sobol-owen": ("DigitalNetB2", "NUS"),
    "qmcpy-lattice": ("Lattice", "SHIFT"),
    "qmcpy-halton": ("Halton", "LMS_DP"),
}
"""Classes of QMCPy and how they are randomised."""

_BELOW_ONE = np.float32(1 - 2**-24)


def rivals() -> dict[str, Callable[[], Entry]]:
    """Return functions that make the entries of what is installed."""
    found: dict[str, Callable[[], Entry]] = {}
    for name, engine in SCIPYS.items():
        found[name] = partial(_entry, name, "scipy", partial(_scipy, engine), f"scipy.stats.qmc.{engine}")
    if find_spec("qmcpy"):
        for name, (engine, randomize) in QMCPYS.items():
            made = partial(_qmcpy, engine, randomize)
            found[name] = partial(_entry, name, "qmcpy", made, f"{engine}, {randomize}")
    if find_spec("torch"):
        found["torch-sobol"] = partial(_entry, "torch-sobol", "torch", _torch, "SobolEngine, scrambled")
    if find_spec("mitsuba"):
        for name in MITSUBAS:
            made = partial(_mitsuba, name)
            found[MITSUBA + name] = partial(_entry, MITSUBA + name, "mitsuba", made, name, image=True)
    return found


def _entry(name: str, package: str, points: Any, what: str, image: bool = False) -> Entry:
    version = importlib.metadata.version(package)
    return Entry(name, f"{package} {version}: {what}", version, points, image, package)


Replicate = Callable[[int, int, int], NDArray]
"""From a seed, number of points and dimensions to the points of one replicate."""


def _replicated(
    replicate: Replicate, width: int, height: int, spp: int, dims: int, key: int
) -> NDArray[np.float32]:
    seeds = key * width * height + np.arange(width * height)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = np.stack([replicate(int(seed), spp, dims) for seed in seeds])
    return np.minimum(made.astype(np.float32), _BELOW_ONE).reshape(height, width, spp, dims)


def _scipy(engine: str, width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
    from scipy.stats import qmc

    made = getattr(qmc, engine)
    return _replicated(lambda s, n, d: made(d, rng=s).random(n), width, height, spp, dims, key)


def _qmcpy(
    engine: str, randomize: str, width: int, height: int, spp: int, dims: int, key: int
) -> NDArray[np.float32]:
    import qmcpy  # pyright: ignore[reportMissingImports]

    made: Any = getattr(qmcpy, engine)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        drawn = made(dims, replications=width * height, seed=key, randomize=randomize)(spp)
    points = np.asarray(drawn, np.float32).reshape(height, width, spp, dims)
    return np.minimum(points, _BELOW_ONE)


def _torch(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
    import torch  # pyright: ignore[reportMissingImports]

    def replicate(seed: int, n: int, d: int) -> NDArray:
        return torch.quasirandom.SobolEngine(d, scramble=True, seed=seed).draw(n).numpy()

    return _replicated(replicate, width, height, spp, dims, key)


def _mitsuba(name: str, width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
    """Record a sampler as integrators call it: the samples of a pixel are neighbours in a wavefront."""
    import mitsuba  # pyright: ignore[reportMissingImports]

    mi: Any = mitsuba
    mi.set_variant("llvm_ad_rgb")
    sampler = mi.load_dict({"type": name, "sample_count": spp})
    if sampler.sample_count() != spp:
        raise NotSupportedError(f"spp must be a number that it takes, got {spp}: {sampler.sample_count()}")
    sampler.set_samples_per_wavefront(spp)
    sampler.seed(key, width * height * spp)
    pairs = []
    for _ in range(dims // 2):
        pair = sampler.next_2d()
        pairs.append(np.stack([np.array(pair.x), np.array(pair.y)], axis=-1))
    points = np.concatenate(pairs, axis=-1).reshape(height, width, spp, dims)
    return np.minimum(points.astype(np.float32), _BELOW_ONE)
