"""Mitsuba images without unnecessary samples, in tiles."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges.mitsuba._given import LIMIT, of_size
from qmcjax.bridges.mitsuba._register import NAME, register, wrap
from qmcjax.bridges.mitsuba._sensors import delegate, load_scene, sensor_of
from qmcjax.core import checks, draws
from qmcjax.rendering import AdaptiveImage
from qmcjax.rendering.stopping import PILOT, check_passes, passes_needed, pilot_of
from qmcjax.samplers import Randomized

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

    The film has the size of the largest tile, with a border as wide as the reconstruction filter: samples
    outside it do not contribute to the tile. At edges of the image the film moves inwards. There is only one
    size, so Mitsuba compiles one program.
    """

    def __init__(self, mitsuba: Any, sensor: Any, side: int) -> None:
        self.sensor, film = sensor, sensor.film()
        if film.class_name() != "HDRFilm":
            raise ValueError(f"sensor must have a film of type hdrfilm, got {film.class_name()}")
        reach = film.rfilter().border_size()
        # This many columns and rows around the whole are sampled, too.
        self.border = reach if film.sample_border() else 0
        self.whole = tuple(int(size) + 2 * self.border for size in film.size())
        self.crop = [int(start) for start in film.crop_offset()]
        self.size = [int(size) for size in film.crop_size()]
        self.edges = [_divide(size, side) for size in self.size]
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

    def render(self, number: int) -> NDArray:
        tiles, corner = self.tiles, self.tiles.corner(number)
        # The sampler's first pixel is that of the whole film, or of its border.
        left, top = (start + crop + tiles.border for start, crop in zip(corner, tiles.crop, strict=True))
        self.sampler.given.show(left, top, tiles.whole)
        self.offset = [start / size for start, size in zip(corner, tiles.size, strict=True)]
        if not self.mitsuba.variant().startswith("scalar"):
            import drjit  # pyright: ignore[reportMissingImports]

            # In memory, not a compiled constant: another tile does not recompile.
            self.offset = [drjit.opaque(self.mitsuba.Float, each) for each in self.offset]
        image = np.array(self.mitsuba.render(self.scene, sensor=self.sensor, spp=self.spp, seed=0))
        rows, columns = tiles.inside(number)
        top, left = rows.start - corner[1], columns.start - corner[0]
        return image[top : top + rows.stop - rows.start, left : left + columns.stop - columns.start]


def _divide(size: int, side: int) -> NDArray[np.intp]:
    """Return the edges of parts of a side of at most ``side`` pixels, which differ by one at most."""
    count = -(-size // checks.integer("tile", side, 1, checks.MAX_SIDE))
    return np.arange(count + 1) * size // count


def render_adaptive(
    scene: Any,
    sampler: Any,
    spp: int,
    tolerance: float,
    *,
    unbiased: bool = False,
    tile: int = 32,
    key: int = 0,
    sensor: int = 0,
) -> AdaptiveImage:
    """Render a Mitsuba 3 scene in passes that stop in each tile when its error is small enough.

    Parameters
    ----------
    scene : path of an XML file, or mitsuba.Scene
        As for :func:`render`. The film must be of type ``hdrfilm``.
    sampler : Sampler, made by :func:`qmcjax.samplers.randomized`, or function
        A function of ``(width, height, spp)`` that returns such a sampler is called with the size of the
        film.
    spp : int, the largest number of samples per pixel: a multiple of the samples of a pass
    tolerance : float
        Take passes in each tile until the root mean square of the standard errors of its pixels and channels
        is at most this, or until they have ``spp`` samples. At least four passes are taken. Positive.
    unbiased : bool
        Decide the number of passes of each tile from four passes that are not part of the image; ``counts``
        includes them. The error is then a prediction from four passes: some tiles remain above the tolerance.
        Otherwise a tile whose first passes happen to agree stops early, and rare bright values are
        underestimated.
    tile : int, the largest width and height of tiles in pixels, in [1, 65536]
        Errors of small tiles are less certain, and the reconstruction filter needs more samples around them.
    key : int
        For requests beyond the sampler's dimensions, independent in each pass.
    sensor : int
        Which of the scene's sensors.

    Returns
    -------
    AdaptiveImage
        ``image`` as from :func:`render`, ``counts`` (samples taken in each pixel of it) and ``saving``, the
        fraction of samples saved: those around tiles, for filters wider than a pixel, count as taken.

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    TypeError, ValueError
        As for :func:`render`; if this tolerance cannot stop passes of the sampler; if the film has another
        type; or if the integrator traces particles from lights, which reach all tiles.

    See Also
    --------
    qmcjax.render_adaptive : for scenes of qmcjax, pixel by pixel

    Notes
    -----
    A tile that never stops has the mean of :func:`render` with each of ``sampler.of_pass(k)``, up to
    rounding. Channels other than colours, such as depth, are rendered, but do not influence stopping. Tiles
    with non-finite values take all passes.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> owen = samplers.randomized(lambda key: samplers.independent(sequences.sobol(8), key), key=1, spp=16)
    >>> result = render_adaptive("scene.xml", owen, spp=1024, tolerance=0.01)  # doctest: +SKIP
    """
    mitsuba, scene = load_scene(scene)
    own = sensor_of(scene, sensor)
    if isinstance(scene.integrator(), mitsuba.AdjointIntegrator):
        raise ValueError(
            "scene must have an integrator that starts from the sensor, since particles from lights reach "
            f"all tiles, got {scene.integrator().class_name()}"
        )
    tiles = Tiles(mitsuba, own, tile)
    spp, key = checks.integer("spp", spp, 1, LIMIT), checks.integer("key", key, 0, LIMIT)
    unbiased = checks.flag("unbiased", unbiased)
    if of_size(sampler):
        sampler = sampler(*tiles.whole, spp)
    check_passes(sampler, spp, tolerance, unbiased)
    tolerance, limit = float(tolerance), spp // sampler.spp
    passes = _Passes(mitsuba, scene, tiles, pilot_of(sampler) if unbiased else sampler, key, unbiased)
    every = np.ones(len(tiles), bool)
    for number in range(PILOT):
        passes.add(number, every)
    spent = PILOT * every
    if unbiased:
        wanted = passes_needed(passes.variance(), tolerance, limit - PILOT)
        passes = _Passes(mitsuba, scene, tiles, sampler, key, False)
        for number in range(int(wanted.max())):
            passes.add(number, wanted > number)
        spent = spent + wanted
    else:
        for number in range(PILOT, limit):
            active = (np.sqrt(passes.variance() / passes.count) > tolerance) & (passes.count == number)
            if not active.any():
                break
            passes.add(number, active)
        spent = passes.count
    return _result(mitsuba, tiles, passes.mean, spent * sampler.spp, spp)


class _Passes:
    """Means of the passes of each tile so far, and the sums of their squared deviations."""

    def __init__(
        self, mitsuba: Any, scene: Any, tiles: Tiles, sampler: Randomized, key: int, pilot: bool
    ) -> None:
        self.mitsuba, self.scene, self.tiles, self.sampler = mitsuba, scene, tiles, sampler
        self.key = jax.random.fold_in(checks.prng_key("key", key), pilot)
        self.count = np.zeros(len(tiles), np.int64)
        self.mean: list[Any] = [0.0] * len(tiles)
        self.squares: list[Any] = [0.0] * len(tiles)

    def add(self, number: int, active: NDArray[np.bool_]) -> None:
        """Add a pass in the active tiles (B. P. Welford, 1962)."""
        beyond = int(draws.bits(jax.random.fold_in(self.key, number), (), jnp.uint32))
        of_pass = self.sampler.of_pass(number)
        one = TiledPass(self.mitsuba, self.scene, self.tiles, of_pass, beyond, self.sampler.spp)
        for k in np.flatnonzero(active).tolist():
            values = one.render(k).astype(np.float64)
            self.count[k] += 1
            deviation = values - self.mean[k]
            self.mean[k] = self.mean[k] + deviation / self.count[k]
            self.squares[k] = self.squares[k] + deviation * (values - self.mean[k])

    def variance(self) -> NDArray[np.float64]:
        """Return the variance of a pass: its mean over the pixels and colours of each tile."""
        colours = self.tiles.channels
        means = [squares[..., :colours].mean() for squares in self.squares]
        # Infinity asks for all passes.
        return np.nan_to_num(np.array(means) / (self.count - 1), nan=np.inf, posinf=np.inf)


def _result(
    mitsuba: Any, tiles: Tiles, means: list[NDArray], samples: NDArray[np.int64], spp: int
) -> AdaptiveImage:
    """Return an image from its tiles, with the numbers of samples taken in them."""
    width, height = tiles.size
    image = np.empty((height, width, means[0].shape[2]), np.float32)
    counts = np.empty((height, width), np.uint32)
    for k, mean in enumerate(means):
        image[tiles.inside(k)], counts[tiles.inside(k)] = mean, samples[k]
    taken = int(samples.sum()) * tiles.region[0] * tiles.region[1]
    return AdaptiveImage(mitsuba.TensorXf(image), counts, 1 - taken / (width * height * spp))
