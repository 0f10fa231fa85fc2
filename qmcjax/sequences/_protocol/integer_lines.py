"""Text files of integers, such as generator matrices and vectors, and their headings."""

from dataclasses import dataclass
from pathlib import Path

from qmcjax.core import tables
from qmcjax.core.tables import Line, wrong

_WORDS = "lattice plattice dnet dnetup sobol soboljk shiftmod1 dshift lmscramble nuscramble".split()
"""Keywords of LDData."""

_LATNET = {
    "parameters for a lattice rule": "lattice",
    "parameters for a polynomial lattice rule": "plattice",
    "parameters for a digital net": "dnet",
    "parameters for sobol points, in jk format": "soboljk",
    "parameters m_": "sobol",
    "initial direction numbers": "sobol",
    "parameters": "other",
    "input command line": "other",
}
"""How LatNet Builder begins the same headings."""


@dataclass
class IntegerFile:
    """The lines of integers that are still to be read, and the comment before them that names the format."""

    lines: list[Line]
    heading: Line
    kind: str = ""
    """A keyword of LDData; empty without a heading, "other" if that of LatNet Builder is unknown."""
    latnet: bool = False

    def header(self, names: str) -> list[Line]:
        """Take the first lines, with one integer each."""
        taken = []
        for _ in names.split(", "):
            line = self.next(names)
            if len(line.values) != 1:
                raise wrong(line.number, f"be one integer of the header: {names}", line.values)
            taken.append(self.lines.pop(0))
        return taken

    def next(self, what: str) -> Line:
        """Return the next line, or raise an error at the end of the file."""
        if not self.lines:
            raise ValueError(f"must contain {what}, got the end of the file")
        return self.lines[0]

    def table(self, count: int, width: int) -> list[list[int]]:
        """Return the remaining lines, of equal length."""
        self.next(f"{count} lines")
        for line in self.lines:
            if len(line.values) != width:
                raise wrong(line.number, f"be {width} integers", line.values)
        if len(self.lines) != count:
            raise wrong(self.lines[-1].number, f"be the last of {count} lines", f"{len(self.lines)} lines")
        return [line.values for line in self.lines]


def integer_file(path: Path, names: str = "") -> IntegerFile:
    """Read a file of integers and comments; its first line may have these names."""
    found = tables.lines(path, True, lambda text: text.split() == names.split() != [])
    start = next((place for place, line in enumerate(found) if line.values), len(found))
    file = IntegerFile([line for line in found if line.values], Line(1, [], ""))
    if not file.lines:
        raise ValueError("must contain integers, got none")
    for line in found[:start]:  # LatNet Builder writes its command line before the heading.
        word = line.comment.partition(" ")[0]
        latnet = next((kind for begin, kind in _LATNET.items() if line.comment.startswith(begin)), "")
        if file.kind in ("", "other") and (word in _WORDS or latnet):
            file.heading, file.kind, file.latnet = line, latnet or word, bool(latnet)
    for line in file.lines:
        if "interlacing" in line.comment:
            raise wrong(line.number, "be no interlacing factor: see sequences.interlaced", line.values)
    return file
