"""Parts of an image of Mitsuba, each rendered on a small film of its own."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges.mitsuba._register import NAME, register, wrap
from qmcjax.bridges.mitsuba._sensors import delegate
from qmcjax.core import checks

_FORMATS = {
    "Y": "luminance",
    "YA": "luminance_alpha",
    "RGB": "rgb",
    "RGBA": "rgba",
    "XYZ": "xyz",
    "XYZA": "xyza",
}


class Tiles:
    """Tiles of a sensor's image, and the film on which all of them are rendered.

    The film has the size of the largest tile, with a border as wide as the reconstruction filter reaches:
    samples outside of it add nothing to the tile. At edges of the image the film moves inwards. There is one
    size only, so that Mitsuba compiles one program.
    """

    def __init__(self, mitsuba: Any, sensor: Any, side: int) -> None:
        self.sensor, film = sensor, sensor.film()
        if film.class_name() != "HDRFilm":
            raise ValueError(f"sensor must have a film of type hdrfilm, got {film.class_name()}")
        reach = film.rfilter().border_size()
        # As many columns and rows around the whole are sampled, too.
        self.border = reach if film.sample_border() else 0
        self.whole = tuple(int(size) + 2 * self.border for size in film.size())
        self.crop = [int(start) for start in film.crop_offset()]
        self.size = [int(size) for size in film.crop_size()]
        self.edges = [_divided(size, side) for size in self.size]
        self.region = [
            min(int(np.diff(edges).max()) + 2 * reach, size + 2 * self.border)
            for edges, size in zip(self.edges, self.size, strict=True)
        ]
        self.reach = reach
        film.prepare([])
        bitmap = film.bitmap()
        self.channels = bitmap.channel_count()
        self.film = mitsuba.load_dict(
            {
                "type": "hdrfilm",
                "width": self.region[0],
                "height": self.region[1],
                "rfilter": film.rfilter(),
                "pixel_format": _FORMATS[bitmap.pixel_format().name],
                "component_format": "float32",
            }
        )

    def __len__(self) -> int:
        return int(np.prod([len(edges) - 1 for edges in self.edges]))

    def inside(self, number: int) -> tuple[slice, slice]:
        """Return rows and columns of a tile in the image."""
        row, column = divmod(number, len(self.edges[0]) - 1)
        (left, right), (top, bottom) = (
            edges[k : k + 2].tolist() for edges, k in zip(self.edges, (column, row), strict=True)
        )
        return slice(top, bottom), slice(left, right)

    def corner(self, number: int) -> tuple[int, int]:
        """Return column and row in the image of the film's first pixel for a tile."""
        rows, columns = self.inside(number)
        first, last = -self.border, [s + self.border - r for s, r in zip(self.size, self.region, strict=True)]
        return (
            min(max(columns.start - self.reach, first), last[0]),
            min(max(rows.start - self.reach, first), last[1]),
        )


class TiledPass:
    """The samples of a sampler in tiles."""

    def __init__(self, mitsuba: Any, scene: Any, tiles: Tiles, sampler: Any, key: int, spp: int) -> None:
        self.mitsuba, self.scene, self.tiles, self.spp = mitsuba, scene, tiles, spp
        plug_in = {"type": NAME, "sampler": wrap(sampler), "film": tiles.film, "key": key}
        register()
        self.sampler = mitsuba.load_dict(plug_in | {"sample_count": spp})
        self.offset: Any = None
        scale = [region / size for region, size in zip(tiles.region, tiles.size, strict=True)]

        def moved(position: Any) -> Any:
            return mitsuba.Point2f(*(scale[k] * position[k] + self.offset[k] for k in (0, 1)))

        self.sensor = delegate(mitsuba, tiles.sensor, tiles.film, self.sampler, moved)

    def rendered(self, number: int) -> NDArray:
        """Return the pixels of a tile, shape (height, width, channels)."""
        tiles, corner = self.tiles, self.tiles.corner(number)
        # The sampler's first pixel is that of the whole film, or of its border.
        left, top = (start + crop + tiles.border for start, crop in zip(corner, tiles.crop, strict=True))
        self.sampler.given.show(left, top, tiles.whole)
        self.offset = [start / size for start, size in zip(corner, tiles.size, strict=True)]
        if not self.mitsuba.variant().startswith("scalar"):
            import drjit  # pyright: ignore[reportMissingImports]

            # In memory, not part of what is compiled: another tile does not compile again.
            self.offset = [drjit.opaque(self.mitsuba.Float, each) for each in self.offset]
        image = np.array(self.mitsuba.render(self.scene, sensor=self.sensor, spp=self.spp, seed=0))
        rows, columns = tiles.inside(number)
        top, left = rows.start - corner[1], columns.start - corner[0]
        return image[top : top + rows.stop - rows.start, left : left + columns.stop - columns.start]


def _divided(size: int, side: int) -> NDArray[np.intp]:
    """Return the edges of parts of a side of at most ``side`` pixels, which differ by one at most."""
    count = -(-size // checks.integer("tile", side, 1, checks.MAX_SIDE))
    return np.arange(count + 1) * size // count
