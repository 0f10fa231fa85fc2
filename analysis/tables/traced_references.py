"""Estimate the reference images of the ray-traced scenes, replicate by replicate.

Run once for each scene (many minutes): ``python -m analysis.tables.traced_references helicopter sports``.

Replicates use points of Sobol's sequence, Owen-scrambled independently in each pixel and replicate; their
scatter gives the standard error of their mean. Each is stored in a folder as soon as it is finished: an
interrupted run resumes with the next one.
"""

import argparse
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

import qmcjax as qj
from analysis.tables import TRACED
from qmcjax import samplers, scenes, sequences
from qmcjax.scenes import traced

REPLICATES = 16

LIMIT = 300_000
"""Maximum number of bytes of a stored image."""

KEY = 2026


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
        path = folder / f"{number:02}.npy"
        if not path.exists():
            unfinished = folder / f"{number:02}.unfinished"
            image = replicate(scene, number, side, spp)
            with unfinished.open("wb") as stream:
                np.save(stream, image)
            os.replace(unfinished, path)
            print(f"{scene.name}: replicate {number + 1} of {REPLICATES}", flush=True)
        images.append(np.load(path).astype(np.float64))
    return np.stack(images)


def combined(images: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of replicates and its standard errors, shapes (side, side, 3) and (side, side).

    Variances of so few replicates scatter by a third. Each is raised to the mean over 3 x 3 pixels if that is
    larger, and the largest of three channels is taken: stored errors are rarely too small.
    """
    variance = images.var(axis=0, ddof=1) / len(images)
    around = uniform_filter(variance, 3, mode="nearest", axes=(0, 1))
    return images.mean(axis=0), np.sqrt(np.maximum(variance, around).max(axis=-1))


def make(name: str, side: int, spp: int, cache: Path, folder: Path = TRACED) -> Path:
    """Write the image of a scene with its default parameters into a folder.

    ``name``: name of the scene. ``side``: side of the image in pixels. ``spp``: samples per pixel, a multiple
    of REPLICATES. ``cache``: folder of the replicates. ``folder``: folder of the image.
    Returns the path of the file. Raises ValueError if a value of the image is not finite, or the file is too
    large.
    """
    scene = getattr(scenes, name)()
    image, error = combined(replicates(scene, side, spp // REPLICATES, cache))
    if not np.isfinite(image).all():
        raise ValueError(
            f"{name} must have finite values, got {int((~np.isfinite(image)).sum())} that are not"
        )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.npz"
    unfinished = path.with_suffix(".unfinished")
    with unfinished.open("wb") as stream:
        traced.save(stream, image, error, traced.content(scene))
    size = unfinished.stat().st_size
    if size > LIMIT:
        unfinished.unlink()
        raise ValueError(f"{path.name} must have at most {LIMIT} bytes, got {size}")
    os.replace(unfinished, path)
    middle, largest = np.median(error), error.max()
    print(
        f"{path}: {size} bytes, mean {image.mean():.4f}, standard error {middle:.1e} (at most {largest:.1e})"
    )
    return path


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the images of the scenes named on the command line."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[*traced.NAMES, []], help="scenes (default: all)")
    parser.add_argument("--spp-log2", type=int, default=14, help="samples per pixel (default: 14, for 16384)")
    parser.add_argument("--size", type=int, default=256, help="side of the images in pixels (default: 256)")
    parser.add_argument(
        "--cache", type=Path, default=Path("out/replicates"), help="folder of finished replicates"
    )
    parser.add_argument("--folder", type=Path, default=TRACED, help="where images go (default: the package)")
    given = parser.parse_args(arguments)
    if given.spp_log2 < 4 or given.size < 1:
        parser.error("--spp-log2 must be at least 4, --size at least 1")
    for name in given.names or traced.NAMES:
        make(name, given.size, 2**given.spp_log2, given.cache, given.folder)


if __name__ == "__main__":
    main()
