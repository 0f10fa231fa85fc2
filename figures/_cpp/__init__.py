"""Programs in C and C++: the image of the benchmark, and points of samplers."""

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FAST = ("-O3", "-march=native")
"""Options of what is timed."""


def compiler(*names: str) -> str | None:
    """Return the first of some compilers that is there."""
    return next(filter(None, map(shutil.which, names)), None)


def compiled(folder: Path) -> Path | None:
    """Compile the reference into a folder, if there is a compiler."""
    found = compiler("c++", "g++", "clang++")
    program = folder / "render"
    if found is None:
        return None
    options = [*FAST, "-ffast-math", "-fopenmp"]
    return program if _run(found, options, Path(__file__).with_name("render.cpp"), program) else None


def library_of(text: str, folder: Path, name: str) -> ctypes.CDLL | None:
    """Compile C source code into a library, if there is a compiler."""
    found = compiler("gcc", "clang", "cc")
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    if found is None:
        return None
    source.write_text(text, encoding="utf-8")
    done = _run(found, [*FAST, "-std=gnu99", "-shared", "-fPIC"], source, library, "-lm")
    return ctypes.CDLL(str(library)) if done else None


def openqmc(checkout: Path, folder: Path) -> ctypes.CDLL | None:
    """Compile the samplers of OpenQMC into a library, if there is a compiler."""
    found = compiler("g++", "clang++", "c++")
    source, library = Path(__file__).with_name("openqmc.cpp"), folder / "openqmc.so"
    if found is None:
        return None
    options = [*FAST, "-std=c++17", "-shared", "-fPIC", "-I", str(checkout / "include")]
    return ctypes.CDLL(str(library)) if _run(found, options, source, library) else None


def _run(found: str, options: Sequence[str], source: Path, out: Path, *libraries: str) -> bool:
    """Run a compiler, print what it says if it fails, and return whether it made the file."""
    command = [found, *options, str(source), "-o", str(out), *libraries]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr, file=sys.stderr)
    return not done.returncode
