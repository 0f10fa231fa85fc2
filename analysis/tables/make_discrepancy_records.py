"""Search for point sets of small star discrepancy, and keep the best of each size.

Run as long and as often as you like: ``python -m analysis.tables.make_discrepancy_records 60`` searches
each size for 60 seconds, starting from the stored points. ``... 60 2:100,220 3:64`` does so for some sizes in
two and in three dimensions. Points are stored as 32-bit fractions, and their exact star discrepancy counts. A
set is replaced only by a better one.
"""

import sys
from pathlib import Path

import numpy as np

from analysis import search_discrepancy, star_discrepancy
from analysis.tables import SEQUENCES

SIZES = {
    2: (16, 20, 32, 60, 64, 100, 128, 140, 220, 256, 500, 512, 1020, 1024, 2048),
    3: (16, 32, 64, 128, 256),
}
"""Powers of 2, and sizes with published values."""

FILE = "discrepancy_records.npz"


def improve(folder: Path, n: int, dims: int, seconds: float) -> None:
    """Search one size; keep what is better, and the seconds that went into it."""
    path, name = folder / FILE, f"{dims}d_{n}"
    kept = dict(np.load(path)) if path.exists() else {}
    spent = float(kept.get(f"{name}_seconds", 0.0))
    start = kept[name] * 2.0**-32 if name in kept else None
    found = search_discrepancy(n, seconds, key=round(spent), dims=dims, start=start)
    words = np.floor(found.points * 2.0**32).astype(np.uint32)
    before, after = (np.inf if start is None else star_discrepancy(start)), star_discrepancy(words * 2.0**-32)
    if after < before:
        kept[name] = words
    kept[f"{name}_seconds"] = np.float64(spent + found.seconds)
    partial = path.with_suffix(".partial.npz")
    np.savez_compressed(partial, **{key: kept[key] for key in sorted(kept)})
    partial.replace(path)
    print(f"{dims}-D {n}: {before:.9f} -> {after:.9f}, {spent + found.seconds:.0f} s in all", flush=True)


def main(seconds: float, sizes: dict[int, tuple[int, ...]], folder: Path = SEQUENCES) -> None:
    """Search all sizes, each for some seconds."""
    for dims, numbers in sizes.items():
        for n in numbers:
            improve(folder, n, dims, seconds)


if __name__ == "__main__":
    pairs = [text.split(":") for text in sys.argv[2:]]
    chosen = {int(dims): tuple(map(int, numbers.split(","))) for dims, numbers in pairs}
    main(float(sys.argv[1]), chosen or SIZES)
