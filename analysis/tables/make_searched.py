"""Search for the matrices of the (0,m,3)-nets and of the (0,2)-sequence of large minimum distance.

Run once (minutes): ``python -m analysis.tables.make_searched``. Longer searches with the same method, some of
them compiled, showed that the targets are within reach in short time. They need not be the largest distances.
"""

from pathlib import Path

from analysis import MatrixSearch, search_matrices
from analysis.tables import SEQUENCES

# fmt: off
NETS = {
    2: 6, 3: 12, 4: 30, 5: 82, 6: 166, 7: 458, 8: 893, 9: 1984, 10: 4375, 11: 10277, 12: 24078, 13: 58446,
    14: 136368, 15: 304387, 16: 689191,
}
"""Squared distances for the nets, each searched for itself."""

SEQUENCE = {
    2: 6, 3: 9, 4: 17, 5: 37, 6: 73, 7: 150, 8: 365, 9: 850, 10: 2080, 11: 4900, 12: 12000, 13: 30000,
    14: 72000, 15: 176000, 16: 430000,
}
"""Squared distances for the nets of one sequence."""
# fmt: on

SEEDS = {4: 3, 6: 3}
"""The seeds of the nets that are slow to find with seed 0."""

STEPS = 10**6


def search(targets: dict[int, int], seed: int) -> MatrixSearch:
    """Return matrices that reach the targets."""
    found = search_matrices(targets, seed=seed, steps=STEPS)
    if not found.reached:
        raise RuntimeError(f"{targets} not reached with seed {seed} in {STEPS} steps")
    return found


def rows(found: MatrixSearch) -> str:
    """Return the rows of both matrices as strings of digits."""
    return " ".join("".join(map(str, row)) for matrix in found.matrices for row in matrix)


def main(folder: Path = SEQUENCES) -> None:
    """Write optimized_nets_3d.txt and optimized_sequence.txt into a folder."""
    lines = [
        "# m, squared minimum distance on the integer grid, rows of C_1, rows of C_2, first digits first"
    ]
    for m, target in NETS.items():
        found = search({m: target}, SEEDS.get(m, 0))
        lines.append(f"{m} {found.squared[m]} {rows(found)}")
        print(lines[-1], flush=True)
    (folder / "optimized_nets_3d.txt").write_text("\n".join(lines) + "\n")

    found = search(SEQUENCE, 0)
    squared = " ".join(map(str, found.squared.values()))
    lines = [
        f"# squared minimum distances of the nets of m = 2, ..., 16: {squared}",
        "# order, rows of C_1, rows of C_2, first digits first",
        f"16 {rows(found)}",
    ]
    print(*lines, sep="\n")
    (folder / "optimized_sequence.txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
