"""Tiles of designed points that repeat over the screen, translated and turned at random."""

from dataclasses import field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike, DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks, draws, tables
from qmcjax.core.bits import hash_pair, hash_word, owen_hash, reverse, to_unit
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.orders import morton
from qmcjax.samplers._base import FEW, Fits, more_samples
from qmcjax.samplers._kinds import OfDims
from qmcjax.samplers._z_index import shuffled
from qmcjax.samplers.turned_tiles import coordinate, stratum_digits, tile_words

_MOVES, _TURNS, _JITTER, _SHUFFLE = 0, 3, 5, 7
"""First seeds of translations (of columns, rows, frames), of turns, of jitter and of boxes."""

_SEEDS = 8

_STREAM = 0x636F7079
"""Stream number of the seeds of further coordinates, distinct from all others of a key."""

_LOG_BLOCK = 4
"""Binary logarithm of the side of the blocks in which further coordinates have a translation each."""

MAX_SPP = 2**16

_MOST_DESIGNED = 16
"""Most samples of a designed tile."""

_PASCAL = ((2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF))
"""Pascal's triangle modulo 2 on pairs of bits, in steps: any i consecutive rows are independent."""


@frozen_pytree
class Tiled(OfDims):
    """Sample s of a pixel is its point of the tile, translated and turned, in one of several equal boxes."""

    loops = True

    tile: Array
    """uint16 (rows, columns, frames, spp, dims): area and place of each pair of coordinates."""
    seeds: Array
    """uint32 (copies, 8, 2): the tile is copied for each group of as many coordinates as it has."""
    frame: Array
    """uint32: the number of the frame."""
    spp: int = field(metadata={"static": True})
    """Number of samples per pixel."""
    family: str | None = field(default=None, metadata={"static": True})
    """The designed tiles for other numbers of samples, if there are any."""
    first: int = field(default=0, metadata={"static": True})
    """The number of the first coordinate among those with seeds: sub-samples have none of copy 0."""

    @property
    def fits(self) -> Fits:
        return Fits(spp=self.spp)

    def finer(self, count: int) -> "Tiled":
        spp = more_samples(self.spp, count, MAX_SPP, powers=True)
        if count == 1:
            return self
        words = self.tile if self.family is None else jnp.asarray(_designed_words(self.family, spp))
        # Translations and turns of its own, as those of further coordinates.
        size = self.tile.shape[-1]
        own = hash_pair(self.seeds[self.first // size :], jnp.uint32(spp))
        return replace(self, tile=words, spp=spp, seeds=jnp.concatenate([self.seeds[:1], own]), first=size)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        hashed = hash_pair(x ^ self.seeds[0, _JITTER, 0], y ^ self.seeds[0, _JITTER, 1])
        down, right = (max(min(_LOG_BLOCK, n.bit_length() - 2), 0) for n in self.tile.shape[:2])
        block = hash_pair(x >> right, y >> down)

        def of_copy(copy: int | Array) -> tuple[Any, Array]:
            moves = self._moves(copy, jnp.uint32(0), block) if self._boxes == 1 else ()
            return moves, hash_pair(hashed ^ self.seeds[copy, _JITTER, 0], self.seeds[copy, _JITTER, 1])

        single, others = self._copies(dims)
        copies = {copy: of_copy(copy) for copy in single}, jax.lax.map(of_copy, others) if others.size else ()
        return x, y, hashed, self._first_box(x, y) if self._boxes > 1 else None, block, copies

    @property
    def _boxes(self) -> int:
        return self.spp // self.tile.shape[3]

    def _first_box(self, x: Array, y: Array) -> Array:
        """Return a number uniform over seeds that takes every value in each square of as many pixels.

        The same holds for its digits from any even place on, which the first samples do not use, and for each
        pixel over frames.
        """
        number = morton(checks.MAX_SIDE, checks.MAX_SIDE).unchecked_position(x ^ y, y) ^ self.frame
        for shift, mask in _PASCAL:
            number = number ^ ((number & np.uint32(mask)) << shift)
        return (number ^ self.seeds[0, _SHUFFLE, 0]) & np.uint32(self._boxes - 1)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        size, first = self.tile.shape[-1], state[3]
        sample = sample if first is None else sample ^ first
        single, others = self._copies(dims)
        of_single, of_others = state[-1]

        def of_copy(copy: int | Array, own: Any) -> list[Array]:
            moved = self._moved(state, sample, copy, *own)
            return [to_unit(self._word(state, sample, copy, j, *moved), dtype) for j in range(size)]

        made = {copy: of_copy(copy, of_single[copy]) for copy in single}
        if others.size:
            rows = jax.lax.map(lambda one: of_copy(*one), (others, of_others))
            made |= dict(zip(others.tolist(), zip(*rows, strict=True), strict=True))
        places = (divmod(self.first + j, size) for j in dims)
        return jnp.stack([made[copy][inside] for copy, inside in places], axis=-1)

    def _copies(self, dims: tuple[int, ...]) -> tuple[list[int], NDArray[np.uint32]]:
        """Return the copies of coordinates: those that are computed one by one, and those in a loop."""
        copies = sorted({(self.first + j) // self.tile.shape[-1] for j in dims})
        single = len(copies) if len(dims) <= FEW else copies.count(0)
        return copies[:single], np.array(copies[single:], np.uint32)

    def _moved(
        self, state: Any, sample: Array, copy: int | Array, moves: Any, shuffle: Array
    ) -> tuple[Array, tuple[Array, ...]]:
        """Return the number of the box, and the place in the tile, of one copy of its dimensions."""
        x, y, hashed, _, block, _ = state
        boxes = self._boxes
        box, number = sample & np.uint32(boxes - 1), sample >> np.uint32(boxes.bit_length() - 1)
        further = not isinstance(copy, int) or copy > 0
        if further:
            # The first 2**k samples of a pixel remain so, but meet those of other copies in another order.
            number = shuffled(number, shuffle, self.tile.shape[3].bit_length() - 1)
        if further and boxes > 1:
            # New in each frame and for each point of the tile, so boxes of two copies combine in all ways.
            seed = hash_pair(hashed ^ self.seeds[copy, _SHUFFLE, 1], self.frame ^ (number << 16))
            digits = boxes.bit_length() - 1
            box = reverse(owen_hash(reverse(box << np.uint32(32 - digits)), seed)) >> np.uint32(32 - digits)
            box = box ^ (self.seeds[copy, _SHUFFLE, 0] & np.uint32(boxes - 1))
        along = []
        for axis, move in enumerate(moves or self._moves(copy, box, block)):
            place = (y, x, self.frame)[axis]
            if further and axis < 2:
                place = place ^ (np.uint32(0) - (move >> 31))
            along.append((place + move) & np.uint32(self.tile.shape[axis] - 1))
        return box, (*jnp.broadcast_arrays(*along, number),)

    def _moves(self, copy: int | Array, box: Array, block: Array) -> list[Array]:
        """Return the translations of a copy: for further ones of each block, new after the tile's frames.

        The first bit of a word, which no translation needs, reflects the block.
        """
        if isinstance(copy, int) and copy == 0:
            return [self._random(_MOVES + axis, 0, box) for axis in range(3)]
        period = self.frame >> np.uint32(self.tile.shape[2].bit_length() - 1)
        return [self._random(_MOVES + axis, copy, box ^ (period << 16), block) for axis in range(3)]

    def _random(self, which: int, copy: int | Array, box: Array, block: Array | None = None) -> Array:
        """Return a word, uniform over the seeds of a copy, for one turn or translation."""
        one = self.seeds[copy, which, 0]
        return hash_pair(one if block is None else one ^ block, self.seeds[copy, which, 1] ^ box)

    def _word(
        self,
        state: Any,
        sample: Array,
        copy: int | Array,
        inside: int,
        box: Array,
        place: tuple[Array, ...],
    ) -> Array:
        size = self.tile.shape[-1]
        pair, axis = divmod(inside, 2)
        # Area and place are the halves of one word, for a single lookup.
        halves = self.tile.reshape(*self.tile.shape[:-1], -1, 2)
        both = lax.bitcast_convert_type(halves, jnp.uint32).at[(*place, pair)].get(mode="promise_in_bounds")
        area, turn = both << 16, both & np.uint32(0xFFFF0000)
        # Jitter of each sample, frame and pair of coordinates fills the digits below the stratum's.
        number = hash_word(sample ^ (self.frame << 16)) + copy * np.uint32(size // 2) + np.uint32(pair)
        seeds = self.seeds[copy, _JITTER + 1]
        jitter = hash_pair(number ^ seeds[0], state[2] ^ seeds[1])
        digits = stratum_digits(self.tile.shape)[pair]
        word = coordinate(
            area | (jitter >> np.uint32(digits)),
            turn + self._random(_TURNS + pair, copy, box),
            axis,
        )
        # The boxes halve the dimensions in turn.
        count = self._boxes.bit_length() - 1
        for k in reversed(range(inside, count, size)):
            word = (word >> 1) | (((box >> np.uint32(k)) & np.uint32(1)) << 31)
        return word


def of_words(words: NDArray[np.uint16], dims: int, spp: int, key: Array | int) -> Tiled:
    random = checks.prng_key("key", key)
    seeds = draws.bits(random, (1, _SEEDS, 2), jnp.uint32)
    copies = -(-dims // words.shape[-1])
    if copies > 1:
        others = draws.bits(jax.random.fold_in(random, _STREAM), (copies - 1, _SEEDS, 2), jnp.uint32)
        seeds = jnp.concatenate([seeds, others])
    return Tiled(dims, jnp.asarray(words), seeds, jnp.zeros((), jnp.uint32), spp)


def tiled(points: ArrayLike, key: Array | int, *, dims: int | None = None, spp: int | None = None) -> Tiled:
    """Sample from a tile of points that the key translates and turns, exactly uniform in every pixel.

    Parameters
    ----------
    points : float ArrayLike, shape (height, width, spp, d) or (height, width, frames, spp, d)
        The points of a tile in [0, 1)^d, with d = 2 or 4: of :func:`analysis.design_samples`, for example.
        Height, width, frames and spp are powers of two.
    key : jax.random.key, or int in [0, 2**32)
        A new key does not recompile.
    dims : int, in [1, 65536], optional
        Number of coordinates, by default d. Further ones are in groups of d, which reuse the tile.
    spp : int, optional
        Number of samples per pixel, a power of two up to 65536, by default that of the tile. More samples
        fill equal boxes of the unit cube, halved along one dimension after another, with one tile in each.
        The first samples visit each box once, in an order that the key, the pixel and the frame choose.

    Returns
    -------
    Tiled
        ``sampler.at_frame(t)`` is the sampler of frame t.

    Notes
    -----
    The key translates the tile by whole pixels and frames, and turns each pair of coordinates: the points at
    equal distance from the centre of the square, in the maximum norm, move along their outline by the same
    fraction of its length. So neighbours remain neighbours, and the square has no seam. The area within the
    outline of a point is jittered in one of several equal strata; the points of each sample number are first
    moved to these strata. Hence **each sample of each pixel is uniform over keys**, to 32 bits, including the
    first: the key chooses its box, the translation its stratum, the jitter its area in the stratum, and the
    turn its place on the outline. With d = 4, two areas have joint equal strata.

    **Groups of coordinates after the first d are independent of each other**: over keys exactly, since each
    has its own seeds; in one image, as random points with equal strata are. For this, each block of 16 x 16
    pixels, or of half the side of a smaller tile, has its own translation and reflections in each of these
    groups, new after the tile's frames; each pixel has its own order of their samples, which keeps the first
    ``2**k``. Two groups have a block in the same place with probability 1 / (4 width height) of the tile:
    areas inside their outlines are then equal in its pixels. At the edges of blocks errors cancel less:
    filtered errors of these groups are 1.1 to 1.3 times those of the first one in two dimensions, and 1.04
    to 1.1 times in four.

    The choice of boxes also keeps the filtered errors of fewer samples small: in any aligned square of as
    many pixels as there are boxes, or in as many frames of a pixel, each box contains one first sample.

    Examples
    --------
    >>> tile = np.random.default_rng(1).random((8, 8, 1, 2))
    >>> sampler = tiled(tile, key=0)
    >>> print(sampler(3, 5, 0).shape, sampler.at_frame(7)(3, 5, 0, dims=(1,)).shape)
    (2,) (1,)
    """
    known = checks.known_array("points", points, np.floating, "an array of floats")
    if known.ndim == 4:
        known = known[:, :, None]
    if known.ndim != 5 or known.shape[-1] not in (2, 4) or known.size == 0:
        raise ValueError(
            "points must have shape (height, width, spp, d) or (height, width, frames, spp, d), d = 2 or 4, "
            f"got {np.shape(points)}"
        )
    if not ((known >= 0) & (known < 1)).all():
        raise ValueError("points must be in [0, 1), got some that are not")
    for size in known.shape[:4]:
        if size & (size - 1) or size > MAX_SPP:
            raise ValueError(
                f"points must have powers of two up to {MAX_SPP} as height, width, frames and spp, "
                f"got {np.shape(points)}"
            )
    dims = known.shape[-1] if dims is None else checks.integer("dims", dims, 1, 2**16)
    count = int(known.shape[3]) if spp is None else checks.power_of_two("spp", spp, MAX_SPP)
    words = tile_words(known.astype(np.float64))
    return of_words(words[:, :, :, :count], dims, count, key)


def designed(
    width: int,
    height: int,
    spp: int,
    key: Array | int,
    dims: int = 2,
    frames: int | None = None,
    *,
    progressive: bool = False,
) -> Tiled:
    """Sample with tiles of points designed by gradient descent on the expected filtered error.

    Parameters
    ----------
    width, height : int, in [1, 65536]
    spp : int, samples of each pixel, a power of two up to 65536
    key : jax.random.key, or int in [0, 2**32)
        A new key does not recompile.
    dims : int, in [1, 65536]
        Number of coordinates. Up to 2, tiles are two-dimensional, otherwise four-dimensional; further
        groups of coordinates reuse the tile, independently, as :func:`tiled` describes.
    frames : int, optional
        For animations: a tile of 32 frames with one sample, designed for filters in space and time. It
        repeats after 32 frames.
    progressive : bool
        Whether the first 1, 2, 4, ... of up to 16 samples are designed, too, for images that are shown while
        they are rendered. Filtered errors are 1.3 to 1.5 times those of tiles for one number of samples in
        two dimensions, and 1.1 to 1.2 times in four.

    Returns
    -------
    Tiled
        See :func:`tiled` for the role of the key, and for more than 16 samples. ``sampler.at_frame(t)`` is
        the sampler of frame t.

    Notes
    -----
    The tiles minimise :func:`analysis.expected_error` over half spaces, after a Gaussian filter of standard
    deviation 1.5 pixels, plus 0.05 times the mean square of the unfiltered error, on average over turns:
    :func:`analysis.design_samples` makes them. In four dimensions the integrands also include half planes of
    the pairs of coordinates (0, 1) and (2, 3), and steps along each coordinate, since scenes often depend on
    few of them. There is one tile for each of 1, 2, 4, 8 and 16 samples, of 64 x 64 pixels up to 2 samples,
    otherwise of 32 x 32. You can render fewer samples of a tile, but they are not designed unless it is
    progressive. Each sample of each pixel is uniform over keys, including the first. The figure
    ``designed-samplers`` shows measured errors.

    Denoisers can keep the repeats of a tile as a texture (figure ``denoisers``), in particular those of the
    progressive one of four dimensions, which has 16 x 16 pixels.

    The design assumes that neighbours have the same integrand, and points are not stratified along the axes.
    In scenes with many edges on the screen, and for smooth functions in four dimensions, samplers with a net
    in each pixel are better from about four samples on: see :func:`qmcjax.recommend`.

    References
    ----------
    .. [1] I. Georgiev, M. Fajardo, "Blue-noise Dithered Sampling", SIGGRAPH Talks, 2016.
    .. [2] C. Salaun, I. Georgiev, H.-P. Seidel, G. Singh, "Scalable Multi-Class Sampling via Filtered Sliced
       Optimal Transport", 2022.
    .. [3] W. Donnelly, A. Wolfe, J. Buetepage, J. Valdes, "FAST: Filter-Adapted Spatio-Temporal Sampling for
       Real-Time Rendering", 2024.

    Examples
    --------
    >>> sampler = designed(16, 16, 4, key=0)
    >>> print(sampler(3, 5, 2).shape, sampler.tile.shape)
    (2,) (32, 32, 1, 4, 2)
    """
    checks.image_size(width, height)
    spp, dims = checks.power_of_two("spp", spp, MAX_SPP), checks.integer("dims", dims, 1, 2**16)
    progressive = checks.flag("progressive", progressive)
    family = f"{2 if dims <= 2 else 4}d_{'progressive' if progressive else ''}"
    if frames is not None:
        checks.integer("frames", frames, 1, checks.INDEX_LIMIT)
        if progressive:
            raise ValueError("progressive must be False for frames, got True")
        (words,) = tables.arrays("samplers", "designed.npz", "frames")
        return of_words(words[:, :, :, :spp], dims, spp, key)
    return replace(of_words(_designed_words(family, spp), dims, spp, key), family=family)


def _designed_words(family: str, spp: int) -> NDArray[np.uint16]:
    name = family if family.endswith("progressive") else f"{family}{min(spp, _MOST_DESIGNED)}"
    (words,) = tables.arrays("samplers", "designed.npz", name)
    return words[:, :, :, :spp]
