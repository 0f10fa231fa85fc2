"""Baked tables: values, their meaning, and files for textures and programs."""

import re
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._arrays import suffix_of
from qmcjax.bridges._images import encode_png, write_exr
from qmcjax.bridges._layout import Layout
from qmcjax.bridges._sources import Coding, c_header, cpp, glsl
from qmcjax.core import checks

_DEPTHS = {".png": (8, 16), ".rg16": (16,), ".rgba32f": (24,), ".exr": (24,)}
"""Bits that files other than ``.npz`` and ``.h`` support."""


@dataclass(frozen=True, eq=False)
class BakedTable:
    """The result of :func:`bake` and related functions, for textures, headers and arrays."""

    values: NDArray = field(repr=False)
    """uint8, uint16, uint32 or (for 24 bits) float32, shape (rows, columns, samples, coordinates)."""
    bits: int
    """8, 16 or 32 for unsigned integers; 24 for floats, exactly."""
    fractions: bool
    """Whether values are coordinates, or plain integers."""
    about: tuple[str, ...]
    """A description of the table, line by line."""

    @property
    def points(self) -> NDArray:
        """The coordinates that readers compute from the values: float32, and for 32 bits float64, exact.

        For 8 and 16 bits they are the centres of the intervals of values, ``(value + 1/2) / 2**bits``, so
        that means are right; for 24 and 32 bits the lower bounds, the sampler's own numbers.
        """
        if not self.fractions:
            raise ValueError("table must be of coordinates to have points, got one of integers")
        if self.bits == 24:
            return self.values
        if self.bits == 32:
            return self.values * 2.0**-32
        return (self.values.astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-self.bits)

    @property
    def readme(self) -> str:
        """The description that is written to files."""
        rows, columns, samples, coordinates = self.values.shape
        meaning = {
            8: "(value + 1/2) / 2**8",
            16: "(value + 1/2) / 2**16",
            24: "the value, a float with 24 digits after the binary point",
            32: "value / 2**32",
        }[self.bits]
        lines = [
            *self.about,
            f"Pixels: {columns} x {rows}. Samples of each: {samples}. Values of a sample: {coordinates}.",
            f"A coordinate is {meaning}." if self.fractions else "Values are integers.",
        ]
        return "\n".join(lines)

    def reader(self, language: str, name: str = "table") -> str:
        """Return a program that reads the table.

        Parameters
        ----------
        language : {"glsl", "cpp"}
            Functions in GLSL from 1.30 on, or ES 3.0, for a texture made of a ``.png``, ``.exr`` or raw file
            of at most 24 bits; or a class in C++11 for a raw file of 16 or 24 bits. A ``.h`` file includes
            its reader.
        name : str
            Prefix of the functions in GLSL, or name of the class; an identifier of C.
        """
        language = checks.choice("language", language, ("glsl", "cpp"))
        depths = (8, 16, 24) if language == "glsl" else (16, 24)
        if self.bits not in depths:
            raise ValueError(f"bits must be one of {depths} for a reader in {language}, got {self.bits}")
        if not isinstance(name, str):
            raise TypeError(f"name must be a name in C, got {checks.shown(name)}")
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
            raise ValueError(f"name must be a name in C, got {checks.shown(name)}")
        layout = self._layout(4 if self.bits == 24 else 2)
        return (glsl if language == "glsl" else cpp)(layout, Coding(self.bits, self.fractions), name)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a file that includes a description of the table.

        Parameters
        ----------
        path : path
            Ends in ``.npz``, for the arrays ``values``, ``bits`` and ``readme``; ``.h``, for a header in C99
            and C++ with functions to read it, named like the file; ``.png``, for 8 or 16 bits, two
            coordinates as red and green (a single one as grey); ``.rg16``, the same as raw uint16; ``.exr``
            (``pip install 'qmcjax[exr]'``) or raw ``.rgba32f``, for 24 bits in float32, four coordinates as
            red, green, blue and alpha. Raw files have no room for text: the description goes to a second
            file with ``.txt`` appended to the name.
        """
        path = checks.path(path)
        suffix = suffix_of(path, (*_DEPTHS, ".npz", ".h"))
        depths = _DEPTHS.get(suffix, (self.bits,))
        if self.bits not in depths:
            raise ValueError(f"path must end in .npz or .h for bits={self.bits}, got {suffix}")
        if suffix == ".npz":
            np.savez_compressed(path, values=self.values, bits=self.bits, readme=self.readme)
        elif suffix == ".h":
            path.write_text(self._header(path.stem), "ascii", "replace", newline="\n")
        else:
            self._save_texture(path, suffix)

    def _layout(self, channels: int) -> Layout:
        rows, columns, samples, coordinates = self.values.shape
        return Layout(rows, columns, samples, coordinates, channels)

    def _save_texture(self, path: Path, suffix: str) -> None:
        layout = self._layout(4 if self.bits == 24 else 2)
        texels, words = layout.texels(self.values), f"{self.readme}\n{_arrangement(layout)}"
        if suffix == ".exr":
            write_exr(path, texels, words)
        elif suffix == ".png":
            blank = np.zeros_like(texels[..., :1])
            single = layout.coordinates == 1
            pixels = texels[..., :1] if single else np.concatenate([texels, blank], axis=-1)
            path.write_bytes(encode_png(pixels, {"Software": "qmcjax", "Description": words}, "linear"))
        else:
            path.write_bytes(texels.astype(texels.dtype.newbyteorder("<")).tobytes())
            path.with_name(f"{path.name}.txt").write_text(f"{words}\n", "utf-8")

    def _header(self, stem: str) -> str:
        name = re.sub(r"\W", "_", stem, flags=re.ASCII)
        name = f"table_{name}" if not name or name[0].isdigit() else name
        # A line that ended in a backslash would continue the comment on the next line.
        comment = "\n".join(f"// {line}".replace("\\", "/") for line in self.readme.splitlines())
        ends = {8: "", 16: "", 24: "f", 32: "u"}[self.bits]
        numbers = [f"{number!s}{ends}" for number in self.values.ravel()]
        lines = [f"    {', '.join(numbers[k : k + 12])}," for k in range(0, len(numbers), 12)]
        return c_header(self._layout(2), Coding(self.bits, self.fractions), name, comment, lines)


def _arrangement(layout: Layout) -> str:
    """Return the description of texels."""
    names = "red, green, blue, alpha".split(", ")[: min(layout.channels, max(layout.coordinates, 2))]
    return (
        f"Texels: {layout.width} x {layout.height}, from the top. Sample s of pixel (x, y) has value j in "
        f"column (l % {layout.across}) * {layout.columns} + x % {layout.columns} and row "
        f"(l / {layout.across}) * {layout.rows} + y % {layout.rows}, rounded down, with "
        f"l = {layout.groups} * s + j / {layout.channels}, and in channel j % {layout.channels} of "
        f"{', '.join(names)}."
    )


def stored(values: NDArray[np.uint32], bits: int, fractions: bool, about: tuple[str, ...]) -> BakedTable:
    """Return the table of the leading bits of 32-bit fractions, or of integers below 2**bits."""
    if fractions:
        values = values >> np.uint32(32 - bits)
    if bits == 24:
        kept = values.astype(np.float32) * np.float32(2.0**-24)
    else:
        kept = values.astype({8: np.uint8, 16: np.uint16, 32: np.uint32}[bits])
    return BakedTable(kept, bits, fractions, about)
