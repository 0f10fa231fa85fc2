"""The figures behind the command line: the project's only registry, read without importing any figure."""

from typing import NamedTuple


class Entry(NamedTuple):
    module: str
    title: str


CATALOGUE = {
    "thesis-5.21": Entry("figures.thesis_5_21", "Minimum distances of (0,m,2)-nets, with Table 5.1"),
    "thesis-6.1": Entry("figures.thesis_6_1", "The checkerboard at 64 samples per pixel"),
    "thesis-6.2": Entry("figures.thesis_6_2", "Convergence on the checkerboard"),
    "thesis-6.3": Entry("figures.thesis_6_3", "The zone plate at 64 samples per pixel"),
    "thesis-6.4": Entry("figures.thesis_6_4", "Convergence on the zone plate"),
    "hilbert-1": Entry(
        "figures.hilbert_1", "Morton and Hilbert curves and their segments in a 3x3 neighbourhood"
    ),
}
