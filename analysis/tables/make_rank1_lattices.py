"""Search for the best three-dimensional rank-1 lattices of 2**1 to 2**16 points, all pairs of components.

Run once (minutes, 5 GB of memory): ``python -m analysis.tables.make_rank1_lattices``.
"""

from pathlib import Path

from analysis.tables import SEQUENCES
from qmcjax.core.number_theory import best_spatial

HEADER = """\
# Rank-1 lattices of n points, generating vector (1, a, b), of the largest toroidal minimum distance:
# all a and b were compared.
# Written by make_rank1_lattices.py.
# n a b squared minimum distance times n**2
"""


def main(folder: Path = SEQUENCES) -> None:
    """Write rank1_lattices.txt into a folder."""
    rows = [(2**m, *best_spatial(2**m)) for m in range(1, 17)]
    text = HEADER + "".join(" ".join(map(str, row)) + "\n" for row in rows)
    (folder / "rank1_lattices.txt").write_text(text)


if __name__ == "__main__":
    main()
