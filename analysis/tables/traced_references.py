"""Estimate the reference images of the ray-traced scenes, replicate by replicate.

Replicates use points of the Sobol' sequence, Owen-scrambled independently in each pixel and replicate; their
scatter gives the standard error of their mean. Each is stored in a folder as soon as it is finished: an
interrupted run resumes with the next one.
"""

import hashlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

import qmcjax as qj
from analysis.tables import write
from qmcjax import samplers, scenes, sequences
from qmcjax.scenes import traced

REPLICATES = 16

LIMIT = 300_000
"""Maximum number of bytes of a stored image."""

KEY = 2026

SIDE, SPP = 256, 2**14
"""Of the images."""

CACHE = Path("out/replicates")
"""Folder of finished replicates."""


def replicate(scene: Any, number: int, side: int, spp: int) -> NDArray[np.float32]:
    """Return one of the independent images, with as many samples in every pixel; sums are compensated."""
    key = jax.random.fold_in(jax.random.key(KEY), number)
    sampler = samplers.independent(sequences.sobol(len(scene.needs)), key)
    return np.asarray(qj.render(scene, sampler, side, side, spp))


def replicates(scene: Any, side: int, spp: int, cache: Path) -> NDArray[np.float64]:
    """Return all images, shape (REPLICATES, side, side, 3); some may be in a folder already.

    The name of the folder identifies the scene with all its numbers: replicates of other scenes are not used.
    """
    of = traced.content(scene)
    digest = hashlib.sha256(of.numbers.tobytes() + of.choices.encode()).hexdigest()[:16]
    folder = cache / f"{scene.name}-{side}-{spp}-{digest}"
    folder.mkdir(parents=True, exist_ok=True)
    images = []
    for number in range(REPLICATES):
        path = folder / f"{number:02}.npz"
        if not path.exists():
            write(path, {"image": replicate(scene, number, side, spp)})
        with np.load(path) as stored:
            images.append(stored["image"].astype(np.float64))
    return np.stack(images)


def combine(images: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of replicates and its standard errors, shapes (side, side, 3) and (side, side).

    Variances of so few replicates scatter by a third. Each is raised to the mean over 3 x 3 pixels if that is
    larger, and the largest of three channels is taken: stored errors are rarely too small.
    """
    variance = images.var(axis=0, ddof=1) / len(images)
    around = uniform_filter(variance, 3, mode="nearest", axes=(0, 1))
    return images.mean(axis=0), np.sqrt(np.maximum(variance, around).max(axis=-1))


def table(name: str) -> Iterator[bytes]:
    """Yield the file of a scene with its default parameters, or raise a ValueError."""
    scene = getattr(scenes, name)()
    image, error = combine(replicates(scene, SIDE, SPP // REPLICATES, CACHE))
    if not np.isfinite(image).all():
        raise ValueError(
            f"{name} must have finite values, got {int((~np.isfinite(image)).sum())} that are not"
        )
    stream = io.BytesIO()
    traced.save(stream, image, error, traced.content(scene))
    if len(content := stream.getvalue()) > LIMIT:
        raise ValueError(f"{name} must have at most {LIMIT} bytes, got {len(content)}")
    yield content
