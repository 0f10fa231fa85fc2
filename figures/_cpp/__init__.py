"""The image of the benchmark in C++."""

import shutil
import subprocess
import sys
from pathlib import Path


def compiled(folder: Path) -> Path | None:
    """Compile the reference into a folder, if there is a compiler."""
    compiler = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        return None
    program = folder / "render"
    options = ["-O3", "-march=native", "-ffast-math", "-fopenmp"]
    source = Path(__file__).with_name("render.cpp")
    done = subprocess.run(
        [compiler, *options, str(source), "-o", str(program)], capture_output=True, text=True
    )
    if done.returncode:
        print(done.stderr, file=sys.stderr)
        return None
    return program
