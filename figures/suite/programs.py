"""Entries that are programs of any language.

The protocol, in full:

1. The command is split as a shell does, and run without one in the current folder. In its words {width},
   {height}, {spp}, {dims} and {seed} are replaced by integers. A command without any of these gets
   ``--width W --height H --spp N --dims D --seed K`` as further words.
2. The program writes the coordinates of all points to its standard output and ends with status 0. Status 2
   means that it does not support these numbers: the suite leaves them out. Any other status is an error, and
   so is no end within 120 seconds. The last line at standard error is shown.
3. Order: pixel rows from y = 0, in a row pixels from x = 0, in a pixel samples from 0, in a sample
   coordinates from 0: width * height * spp * dims numbers in [0, 1).
4. Coordinates 0 and 1 are the position in the pixel; pixel (x, y) is [x, x+1) x [y, y+1).
5. Numbers are float32, little-endian, without a header; or text, separated by blanks, commas or line ends.
   Output that has only characters of decimal numbers is text.
6. The seed is 0, 1, ...: equal seeds give equal points, others independent ones.
"""

import hashlib
import os
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from figures.suite.entries import Entry, NotSupportedError
from qmcjax.core import packages

SECONDS = 120.0
"""Time that a program has for one image."""

NOT_SUPPORTED = 2
"""Exit status of a program that does not support the numbers."""

TEXT = re.compile(rb"[0-9eE+\-.,\s]*")

NAMES = ("width", "height", "spp", "dims", "seed")


def of_program(command: str) -> Entry:
    """Return the entry of a command.

    Raises
    ------
    ValueError
        If it is empty, or its quotes are not closed.
    """
    words = shlex.split(command)
    if not words:
        raise ValueError("--program must be a command, got ''")
    if not any(f"{{{name}}}" in word for word in words for name in NAMES):
        words += [part for name in NAMES for part in (f"--{name}", f"{{{name}}}")]

    def points(width: int, height: int, spp: int, dims: int, key: int) -> NDArray[np.float32]:
        given: dict[str, int] = dict(zip(NAMES, (width, height, spp, dims, key), strict=True))
        return parsed(_output(words, given), (height, width, spp, dims))

    digest = hashlib.sha256(command.encode())
    for word in words:
        if Path(word).is_file():
            digest.update(Path(word).read_bytes())
    return Entry(Path(words[0]).stem, f"program {command}", digest.hexdigest(), points)


def parsed(data: bytes, shape: tuple[int, int, int, int]) -> NDArray[np.float32]:
    """Return the points that a program wrote, shape (height, width, spp, dims).

    Raises
    ------
    ValueError
        If there are not as many numbers, or some that are not in [0, 1).
    """
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
    filled = [_filled(word, given) for word in words]
    shown = shlex.join(filled)
    environment = {name: value for name, value in os.environ.items() if name != packages.SAFE}
    try:
        done = subprocess.run(
            filled, capture_output=True, stdin=subprocess.DEVNULL, timeout=SECONDS, env=environment
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"{shown} did not end within {SECONDS:g} seconds") from None
    except OSError as error:
        raise ValueError(f"{shown} cannot be run: {error.strerror}") from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        why = f"{shown} ended with status {done.returncode}" + "".join(f": {line}" for line in said)
        raise (NotSupportedError if done.returncode == NOT_SUPPORTED else ValueError)(why)
    return done.stdout


def _filled(word: str, given: dict[str, int]) -> str:
    for name, value in given.items():
        word = word.replace(f"{{{name}}}", str(value))
    return word
