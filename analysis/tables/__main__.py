"""Regenerate data of the library: ``python -m analysis.tables NAME ...``.

Without a name, all programs are listed. Each yields its table part by part: lines of a text, arrays of an
archive. What there is so far is stored after each part; whole files (bytes) replace it. Programs that compare
floating point sums may end in other tables on another CPU.
"""

import argparse
import time
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from analysis.tables import CHOOSING, ORDERS, SAMPLERS, SEQUENCES, TRACED, Content, write
from qmcjax.scenes import traced

TABLES: dict[str, tuple[Any, ...]] = {
    "joe_kuo.npz": ("sobol_components:joe_kuo", SEQUENCES),  # Half a minute.
    "rank1_lattices.txt": ("large_distances:lattices", SEQUENCES),  # Minutes, 5 GB of memory.
    "optimized_nets.txt": ("large_distances:plane_nets", SEQUENCES),  # Half a minute.
    "optimized_nets_3d.txt": ("large_distances:space_nets", SEQUENCES),  # Minutes.
    "optimized_sequence.txt": ("large_distances:sequence", SEQUENCES),  # Minutes.
    "quadruples.txt": ("quadruples:table", SEQUENCES),  # Minutes.
    "niederreiter_xing.txt": ("niederreiter_xing:table", SEQUENCES),  # Half a minute.
    "one_two.txt": ("sobol_components:pairs", SEQUENCES),  # Minutes.
    "discrepancy_records.npz": ("discrepancy_records:table", SEQUENCES, "star"),  # A minute for each size.
    "l2_discrepancy_records.npz": ("discrepancy_records:table", SEQUENCES, "periodic", "average"),
    "optimized.npz": ("optimized_orders:orders", ORDERS),  # Minutes.
    "optimized_ranks.npz": ("optimized_orders:ranks", SAMPLERS),  # Minutes.
    "optimized_joint.txt": ("joint_orders:table", SAMPLERS),  # A minute.
    "optimized_moving.txt": ("moving_orders:table", SAMPLERS),  # Minutes.
    "progressive.npz": ("progressive:table", SAMPLERS),  # Minutes.
    "window_lattice.txt": ("window_lattice:table", SAMPLERS),  # A minute, 3 GB of memory.
    "masks.npz": ("tiles:both_masks", SAMPLERS),  # Minutes.
    "ranked.npz": ("tiles:ranked", SAMPLERS),  # Minutes.
    "designed.npz": ("tiles:table", SAMPLERS),  # An hour on two cores.
    "recommendations.csv": (
        "recommendations:table",
        CHOOSING,
        "images",
    ),  # Minutes, all rows.
    "recommendations_frames.csv": ("recommendations:table", CHOOSING, "frames"),
    "recommendations_prefixes.csv": ("recommendations:table", CHOOSING, "prefixes"),
    **{f"{scene}.npz": ("traced_references:table", TRACED, scene) for scene in traced.NAMES},  # Many minutes.
}
"""Name of the file: the program, which is in this package, the folder, and arguments of the program."""


def joined(content: Content | None, part: Content) -> Content:
    """Return the content of a file with one more part of its table."""
    if isinstance(content, str) and isinstance(part, str):
        return content + part
    return content | part if isinstance(content, dict) and isinstance(part, dict) else part


def main(arguments: list[str] | None = None) -> None:
    """Make the files named on the command line."""
    parser = argparse.ArgumentParser(prog="python -m analysis.tables", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="file to make")
    parser.add_argument("--folder", type=Path, help="where files go (default: the package that reads them)")
    given = parser.parse_args(arguments)
    if unknown := set(given.names) - set(TABLES):
        parser.error(f"NAME must be one of {', '.join(TABLES)}, got {', '.join(sorted(unknown))}")
    for name in given.names or TABLES:
        program, folder, *of = TABLES[name]
        path = (given.folder or folder) / name
        if not given.names:
            print(path, program, *of)
            continue
        began, content = time.monotonic(), None
        for part in resolve_name(f"analysis.tables.{program}")(*of):
            content = joined(content, part)
            write(path, content)
            print(f"{path}: {path.stat().st_size} bytes after {time.monotonic() - began:.0f} s", flush=True)


if __name__ == "__main__":
    main()
