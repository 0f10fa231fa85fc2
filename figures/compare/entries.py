"""Entries of a comparison that are made by other code: programs and projects.

The protocol, in full:

1. The command is split like by a shell, and runs in the current folder without one. In its words {width},
   {height}, {spp}, {dims} and {seed} are replaced by integers. A command without any of these gets
   ``--width W --height H --spp N --dims D --seed K`` appended.
2. The program writes the coordinates of all points to standard output and exits with status 0. Status 2
   means that it does not support these numbers, which are then left out. Any other status is an error, as is
   running for more than 120 seconds. The last line on standard error is shown.
3. Order: rows of pixels from y = 0, pixels of a row from x = 0, samples of a pixel from 0, coordinates of a
   sample from 0. In total width * height * spp * dims numbers in [0, 1).
4. Coordinates 0 and 1 are the position in the pixel; pixel (x, y) is [x, x+1) x [y, y+1).
5. Numbers are float32, little-endian, without a header; or text, separated by blanks, commas or line ends.
   Output that contains only characters of decimal numbers is text.
6. The seed is 0, 1, ...: equal seeds give equal points, different seeds independent ones.
"""

import hashlib
import importlib.metadata
import os
import re
import shlex
import subprocess
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import packages

Points = Callable[[int, int, int, int, int], NDArray[np.float32]]
"""From width, height, samples per pixel, dimensions and key to points (height, width, spp, dims)."""

Make = Callable[[int, int, int, int, int], Any]
"""From width, height, samples per pixel (or frames), dimensions and key to a sampler."""

SECONDS = 120.0
"""Time limit of a program for one image."""

NOT_SUPPORTED = 2
"""Exit status of a program that does not support the numbers."""

TEXT = re.compile(rb"[0-9eE+\-.,\s]*")

NAMES = ("width", "height", "spp", "dims", "seed")

SCIPYS = {"scipy-sobol": "Sobol", "scipy-halton": "Halton", "scipy-latin": "LatinHypercube"}

QMCPYS = {
    "qmcpy-sobol": ("DigitalNetB2", "LMS_DS"),
    "qmcpy-sobol-owen": ("DigitalNetB2", "NUS"),
    "qmcpy-lattice": ("Lattice", "SHIFT"),
    "qmcpy-halton": ("Halton", "LMS_DP"),
}
"""Classes of QMCPy and how they are randomised."""

Pixels = Callable[[int, int, int, int], Any]
"""From a number of pixels, samples per pixel, dimensions and key to the points of all pixels in order."""


class NotSupportedError(ValueError):
    """An entry has no points of this size, number of samples, or dimensions: not an error of it."""


def reason(error: Exception) -> str:
    """Return what an error says, with its kind if it is none of ours."""
    return str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"


@dataclass(frozen=True)
class Entry:
    """A sampler or sequence that takes part."""

    name: str
    text: str
    """How the command line names it."""
    origin: str
    """What it is, with its version, in words."""
    digest: str
    """Another one wherever the points may be others."""
    points: Points
    image: bool = True
    """Whether pixels have a place: else they are replicates of a sequence, and there are no images of it."""
    make: Make | None = None
    """The sampler, if the points come from one."""
    animation: Points | None = None
    """From width, height, frames, dimensions and key to one point per pixel, (frames, height, width, dims).
    Without it, each frame has a key of its own."""


def of_program(command: str) -> Entry:
    """Return the entry of a command; a ValueError if it is empty, or its quotes are not closed."""
    words = shlex.split(command)
    if not words:
        raise ValueError("--program must be a command, got ''")
    if not any(f"{{{name}}}" in word for word in words for name in NAMES):
        words += [part for name in NAMES for part in (f"--{name}", f"{{{name}}}")]

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        given: dict[str, int] = dict(zip(NAMES, (width, height, spp, dims, key), strict=True))
        return read(_output(words, given), (height, width, spp, dims))

    digest = hashlib.sha256(command.encode())
    for word in words:
        if Path(word).is_file():
            digest.update(Path(word).read_bytes())
    return Entry(Path(words[0]).stem, command, f"program {command}", digest.hexdigest(), points)


def read(data: bytes, shape: tuple[int, int, int, int]) -> NDArray[np.float32]:
    """Return the points that a program wrote, (height, width, spp, dims); a ValueError if these are none."""
    height, width, spp, dims = shape
    wanted = f"{width} x {height} pixels x {spp} samples x {dims} dimensions = {np.prod(shape)}"
    if TEXT.fullmatch(data):
        try:
            numbers = np.array(data.replace(b",", b" ").split(), np.float32)
        except ValueError as error:
            raise ValueError(f"it must write numbers: {error}") from None
    elif len(data) % 4:
        raise ValueError(f"it must write {wanted} float32, got {len(data)} bytes")
    else:
        numbers = np.frombuffer(data, "<f4").astype(np.float32)
    if numbers.size != np.prod(shape):
        raise ValueError(f"it must write {wanted} numbers, got {numbers.size}")
    outside = np.flatnonzero(~((numbers >= 0) & (numbers < 1)))
    if len(outside):
        row, column, sample, axis = (int(place) for place in np.unravel_index(outside[0], shape))
        raise ValueError(
            f"coordinate {axis} of pixel ({column}, {row}), sample {sample}, is {numbers[outside[0]]}: "
            "coordinates are in [0, 1)"
        )
    return numbers.reshape(shape)


def _output(words: list[str], given: dict[str, int]) -> bytes:
    for name, value in given.items():
        words = [word.replace(f"{{{name}}}", str(value)) for word in words]
    shown = shlex.join(words)
    how: dict[str, Any] = {"capture_output": True, "stdin": subprocess.DEVNULL, "timeout": SECONDS}
    how["env"] = {name: value for name, value in os.environ.items() if name != packages.SAFE}
    try:
        done = subprocess.run(words, **how)
    except subprocess.TimeoutExpired:
        raise ValueError(f"{shown} did not end within {SECONDS:g} seconds") from None
    except OSError as error:
        raise ValueError(f"{shown} cannot be run: {error.strerror}") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        why = f"{shown} ended with status {done.returncode}" + "".join(f": {line}" for line in said)
        raise (NotSupportedError if done.returncode == NOT_SUPPORTED else ValueError)(why)
    return done.stdout


def available() -> dict[str, Callable[[], Entry]]:
    """Return functions that make the entries of other projects that are installed."""
    known: dict[str, tuple[str, str, Pixels]] = {}
    for name, engine in SCIPYS.items():
        known[name] = "scipy", f"scipy.stats.qmc.{engine}", partial(_scipy, engine)
    for name, how in QMCPYS.items():
        known[name] = "qmcpy", ", ".join(how), partial(_qmcpy, *how)
    known["torch-sobol"] = "torch", "SobolEngine, scrambled", _torch
    return {name: partial(_of_project, name, *of) for name, of in known.items() if find_spec(of[0])}


def _of_project(name: str, package: str, what: str, pixels: Pixels) -> Entry:
    """Return the entry of another project's own code; sequences have a seed of its own in each pixel."""
    version = importlib.metadata.version(package)

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            of_pixels = np.asarray(pixels(width * height, spp, dims, key), np.float32)
        return np.minimum(of_pixels, np.float32(1 - 2**-24)).reshape(height, width, spp, dims)

    return Entry(name, name, f"{package} {version}: {what}", version, points, False)


def _scipy(engine: str, pixels: int, spp: int, dims: int, key: int) -> Any:
    from scipy.stats import qmc

    seeds = range(key * pixels, (key + 1) * pixels)
    return [getattr(qmc, engine)(dims, rng=seed).random(spp) for seed in seeds]


def _qmcpy(engine: str, randomize: str, pixels: int, spp: int, dims: int, key: int) -> Any:
    import qmcpy  # pyright: ignore[reportMissingImports]

    return getattr(qmcpy, engine)(dims, replications=pixels, seed=key, randomize=randomize)(spp)


def _torch(pixels: int, spp: int, dims: int, key: int) -> Any:
    import torch  # pyright: ignore[reportMissingImports]

    seeds = range(key * pixels, (key + 1) * pixels)
    engine = partial(torch.quasirandom.SobolEngine, dims, scramble=True)
    return [engine(seed=seed).draw(spp).numpy() for seed in seeds]
