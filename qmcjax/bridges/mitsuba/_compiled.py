"""Source code, compiled once by the system's compiler: shared libraries in a folder of the user."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from threading import Lock

PACKAGES = "Debian: apt install g++; macOS: xcode-select --install"
"""What compilers are in."""

_LOCK = Lock()


class NotCompiled(Exception):
    """Why there is no library, and what helps."""


@cache
def compiler(language: str) -> str:
    """Return the compiler of a language: CC or CXX of the environment, else cc or c++.

    Raises
    ------
    NotCompiled
        If there is none.
    """
    variable, usual = {"c": ("CC", "cc"), "c++": ("CXX", "c++")}[language]
    command = os.environ.get(variable) or usual
    found = shutil.which(command)
    if found is None:
        raise NotCompiled(f"there is no compiler {command!r} ({PACKAGES})")
    return found


def library(text: str, language: str, flags: Sequence[str] = (), linked: Sequence[str] = ()) -> ctypes.CDLL:
    """Return the library of some source code with others linked to it, compiled unless it was before.

    Raises
    ------
    NotCompiled
        If there is no compiler, if it fails, or if there is no folder for its result.
    """
    command = [compiler(language), "-O2", "-shared", "-fPIC", *flags, "-x", language, "-"]
    command += ["-x", "none", *linked, "-lm"]
    made_of = repr((command, _version(command[0]), text))
    with _LOCK:  # Threads of Mitsuba ask for the same library at once.
        try:
            path = _folder() / f"{hashlib.sha256(made_of.encode()).hexdigest()}.so"
            if not path.exists():
                _compile(command, text, path)
            return ctypes.CDLL(str(path))
        except OSError as error:
            raise NotCompiled(
                f"the library of compiled functions cannot be kept or loaded: {error}"
            ) from error


def _compile(command: Sequence[str], text: str, path: Path) -> None:
    handle, temporary = tempfile.mkstemp(suffix=".so", dir=path.parent)
    os.close(handle)
    try:
        done = subprocess.run([*command, "-o", temporary], input=text, capture_output=True, text=True)
        if done.returncode:
            first = next((line for line in done.stderr.splitlines() if "error" in line), "")
            raise NotCompiled(f"{command[0]} ended with {done.returncode}: {first}")
        os.replace(temporary, path)
    finally:
        Path(temporary).unlink(missing_ok=True)


@cache
def _version(command: str) -> str:
    """Return what a compiler says about itself: another one compiles again."""
    return subprocess.run([command, "--version"], capture_output=True, text=True).stdout


def _folder() -> Path:
    """Return the folder for libraries, below the user's folder for what can be made again."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(named):  # The specification has others ignored.
        caches = Path(named)
    else:
        caches = Path(os.path.expanduser("~")) / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    folder = caches / "qmcjax" / "mitsuba"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # Who writes to it has his code run here.
    return folder
