"""Programs in C++: points of samplers, and the thesis's Gray codes."""

import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

FAST = ("-O3", "-march=native")
"""Options of what is timed."""


def compiled(folder: Path, name: str) -> Path | None:
    """Compile a program into a folder, if there is a compiler."""
    source, program = Path(__file__).with_name(f"{name}.cpp"), folder / name
    done = _run(("c++", "g++", "clang++"), [*FAST, "-ffast-math", "-fopenmp"], source, program)
    return program if done else None


def _run(compilers: Sequence[str], options: Sequence[str], source: Path, out: Path, *libraries: str) -> bool:
    """Run the first compiler that is there, print what it says if it fails; return if it made the file."""
    found = next(filter(None, map(shutil.which, compilers)), None)
    if found is None:
        return False
    command = [found, *options, str(source), "-o", str(out), *libraries]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr, file=sys.stderr)
    return not done.returncode
