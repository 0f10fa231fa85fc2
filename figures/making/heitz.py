"""The published tables of Heitz et al. (2019), which are not shipped: find and read the user's copy.

E. Heitz, L. Belcour, V. Ostromoukhov, D. Coeurjolly, J.-C. Iehl, "A Low-Discrepancy Sampler that Distributes
Monte Carlo Errors as a Blue Noise in Screen Space", SIGGRAPH Talks, 2019, come with C++ files
``samplerBlueNoiseErrorDistribution_128x128_OptimizedFor_2d2d2d2d_<N>spp.cpp``, for N from 1 to 256.
"""

import os
import re
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

SWITCH = "QMCJAX_FIGURES_HEITZ"
"""The environment variable that passes the path of the file to worker processes."""

SEQUENCE, TILE, OPTIMISED = 256, 128, 8
"""Number of samples and of dimensions of the sequence, side of the tile, number of dimensions with keys."""

SIZES = {
    "sobol_256spp_256d": SEQUENCE * SEQUENCE,
    "scramblingTile": TILE * TILE * OPTIMISED,
    "rankingTile": TILE * TILE * OPTIMISED,
}
"""The names of the arrays in the files, and their sizes."""


class Tables(NamedTuple):
    """Arrays of uint8, flat as in the files."""

    sequence: Any
    """Dimension d of sample s at ``256 s + d``."""
    scrambling: Any
    """Key of dimension d of the pixel in column x and row y at ``8 (x + 128 y) + d``."""
    ranking: Any
    """Keys of the sample numbers, in the same layout."""


def path() -> Path | None:
    """Return the file that the user has named, if any."""
    named = os.environ.get(SWITCH)
    return Path(named) if named else None


def read(file: Path) -> Tables:
    """Read the tables from one of the C++ files, or from an ``.npz`` with arrays of the same names.

    Raises OSError if it cannot be read, and ValueError if an array is missing or has another size, or numbers
    other than integers from 0 to 255.
    """
    arrays = _read_npz(file) if file.suffix == ".npz" else _read_cpp(file)
    missing = [name for name in SIZES if name not in arrays]
    if missing:
        raise ValueError(f"{file} has no array {', '.join(missing)}")
    return Tables(*(_to_bytes(f"{name} of {file}", arrays[name], size) for name, size in SIZES.items()))


def _read_npz(file: Path) -> dict[str, Any]:
    import numpy as np

    try:
        with np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in SIZES if name in arrays}
    except (zipfile.BadZipFile, ValueError, EOFError) as error:
        raise ValueError(f"{file} is no .npz of plain arrays: {error}") from None


def _read_cpp(file: Path) -> dict[str, Any]:
    """Return the initialisers ``name[...] = { ... }`` of the three arrays."""
    import numpy as np

    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{file} is neither a C++ file nor an .npz: it is no text") from None
    text = re.sub(r"//[^\n]*|/\*.*?\*/", " ", text, flags=re.DOTALL)
    arrays = {}
    for name in SIZES:
        if initialiser := re.search(rf"\b{name}\s*\[[^\]]*\]\s*=\s*\{{([^}}]*)\}}", text):
            words = re.findall(r"[^\s,]+", initialiser[1])
            wrong = next((word for word in words if not re.fullmatch(r"-?\d{1,9}", word)), None)
            if wrong is not None:
                raise _not_bytes(f"{name} of {file}", repr(wrong[:40]))
            arrays[name] = np.array(words, np.int64)
    return arrays


def _to_bytes(name: str, values: Any, size: int) -> Any:
    import numpy as np

    flat = values.ravel()
    if flat.size != size:
        raise ValueError(f"{name} must have {size} numbers, got {flat.size}")
    if not np.issubdtype(flat.dtype, np.integer):
        raise _not_bytes(name, flat.dtype)
    outside = flat[(flat < 0) | (flat > 255)]
    if outside.size:
        raise _not_bytes(name, outside[0])
    return flat.astype(np.uint8)


def _not_bytes(name: str, got: object) -> ValueError:
    return ValueError(f"{name} must have integers from 0 to 255, got {got}")
