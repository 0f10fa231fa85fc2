"""EXR files, by the package OpenEXR: parts, layers and channels."""

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qmcjax.core import tables

_COLOURS = ("RGBA", "RGB", "Y")
_COMPONENTS = ("RGBA", "RGB", "XYZW", "XYZ", "UV", "XY", "Y")
"""Of layers, the first ones preferred."""

_CHECKSUM = "qmcjaxCrc32"
"""Attribute of our files: ZIP leaves chunks that do not become smaller without a checksum."""


class Layer(NamedTuple):
    """The channels whose names differ in what follows the last dot, the component."""

    channels: dict[str, NDArray]
    data: NDArray
    """(2, 2): first and last column and row of the pixels."""
    display: NDArray
    """(2, 2): those of the image."""

    @property
    def whole(self) -> dict[str, NDArray]:
        """The channels of full resolution."""
        size = tuple((self.data[1] - self.data[0] + 1)[::-1])
        return {name: each for name, each in self.channels.items() if each.shape == size}

    @property
    def components(self) -> str:
        """The first of the known components that are all floats, or an empty string."""
        kept = {name.upper() for name, pixels in self.whole.items() if pixels.dtype.kind == "f"}
        found = next((names for names in _COMPONENTS if kept.issuperset(names)), "")
        return "" if found == "Y" and self.channels.keys() & {"RY", "BY"} else found

    def pixels(self, components: Iterable[str]) -> NDArray:
        """Return an array (height, width, components) of the display window."""
        low, high = self.data - self.display
        if (low < 0).any() or (high > 0).any():
            windows = " and ".join(str(window.tolist()) for window in (self.data, self.display))
            raise ValueError(f"must have its data window within its display window, got {windows}")
        upper = {name.upper(): pixels for name, pixels in self.whole.items()} | self.whole
        crop = np.stack([upper[name] for name in components], axis=-1)
        dtype = np.uint32 if crop.dtype.kind == "u" else np.float32
        pixels = np.zeros((*(self.display[1] - self.display[0] + 1)[::-1], crop.shape[2]), dtype)
        pixels[low[1] :, low[0] :][: crop.shape[0], : crop.shape[1]] = crop
        return pixels


class Exr(NamedTuple):
    """The layers of a file by name."""

    layers: dict[str, Layer]
    first: str
    """The name of what the first part has outside of layers, if anything."""

    def pick(self, layer: str | None) -> NDArray:
        """Return an array (height, width, components): of the layer or channel named, or of the colours."""
        if layer is None:
            coloured = {n: each for n, each in self.layers.items() if each.components in _COLOURS}
            name = self.first if self.first in coloured or len(coloured) != 1 else next(iter(coloured))
            if name in coloured:
                return coloured[name].pixels(coloured[name].components)
            if self.layers.keys() == {name}:
                found = ", ".join(f"{n} {p.dtype} {p.shape}" for n, p in sorted(self.layers[name][0].items()))
                what = "floats of full resolution as channels RGBA, RGB, or Y without chroma RY and BY"
                raise ValueError(f"must have {what}, got {found}")
        else:
            choices = self._choices()
            near = [name for name in choices if name.endswith(f".{layer}")]
            if layer in choices or len(near) == 1:
                name, components = choices[layer if layer in choices else near[0]]
                return self.layers[name].pixels(components)
        raise ValueError(f"layer must be one of {self.listed()}, got {layer!r}")

    def _choices(self) -> dict[str, tuple[str, Iterable[str]]]:
        """Return layers and their components by the names of layers and of single channels."""
        choices = {}
        for name, layer in self.layers.items():
            found = layer.components or (layer.whole if len(layer.whole) == 1 else "")
            if name and found:
                choices[name] = name, found
        for name, layer in self.layers.items():
            for component in layer.whole:
                choices.setdefault(f"{name}.{component}" if name else component, (name, [component]))
        return choices

    def listed(self) -> str:
        """Return the names of layers and channels."""
        names = ((name, ", ".join(sorted(layer.whole))) for name, layer in sorted(self.layers.items()))
        return "; ".join(f"{name!r} ({channels})" if name else channels for name, channels in names)


def write_exr(path: Path, pixels: NDArray[np.float32], comment: str) -> None:
    """Write pixels of shape (height, width, channels), 1, 3 or 4 of them."""
    package = _open(path)
    names = next(names for names in _COLOURS if len(names) == pixels.shape[2])
    header = {
        "compression": package.ZIP_COMPRESSION,
        "type": package.scanlineimage,
        "comments": comment,
        _CHECKSUM: _checksum(pixels, names),
    }
    channels = {name: np.ascontiguousarray(pixels[..., k]) for k, name in enumerate(names)}
    with tables.replaced(path) as temporary, package.File(header, channels) as file:
        temporary.touch()  # Raises an OSError if it cannot be written; the package raises RuntimeErrors.
        file.write(str(temporary))


def read_exr(path: Path) -> Exr:
    """Return the layers of a file; a ValueError begins with the place."""
    with path.open("rb") as stream:
        magic = stream.read(4)
    if magic != struct.pack("<I", 20000630):
        raise ValueError(f"byte 0, must be an EXR file, got {magic!r}")
    package, wanted = _open(path), ("dataWindow", "displayWindow")
    try:
        with package.File(str(path), separate_channels=True) as file:
            # The package empties headers of closed files.
            announced = file.header().get(_CHECKSUM)
            parts = {
                part.name() if len(file.parts) > 1 else "": (
                    [np.array(part.header[name], int) for name in wanted],
                    {name: channel.pixels for name, channel in part.channels.items()},
                )
                for part in file.parts
            }
    except Exception as error:  # RuntimeError, UnicodeDecodeError, ...
        raise ValueError(f"byte 4, must be a whole EXR file: {error}") from None
    layers: dict[str, Layer] = {}
    for part, (windows, channels) in parts.items():
        for channel, pixels in channels.items():
            name, _, component = channel.rpartition(".")
            if part and not f"{name}.".startswith(f"{part}."):
                name = f"{part}.{name}" if name else part
            layers.setdefault(name, Layer({}, *windows)).channels[component] = pixels
    exr = Exr(layers, next(iter(parts), ""))
    if announced is not None:
        components = layers[exr.first].components if exr.first in layers else ""
        found = _checksum(layers[exr.first].pixels(components), components) if components else None
        if announced != found:
            raise ValueError(f"byte 4, must be pixels with their checksum, got {found}")
    return exr


def _open(path: Path) -> Any:
    try:
        import OpenEXR  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ImportError(
            "path must end in .hdr, .npy, .pfm or .png without the package OpenEXR "
            f"(pip install 'qmcjax[exr]'), got {path}"
        ) from None
    return OpenEXR


def _checksum(pixels: NDArray[np.float32], names: str) -> int:
    """Return the CRC-32 of all lines, channel by channel, as an int32."""
    lines = np.stack([pixels[..., names.index(name)] for name in sorted(names)], axis=1)
    return int(np.uint32(zlib.crc32(lines.astype("<f4").tobytes())).view(np.int32))
