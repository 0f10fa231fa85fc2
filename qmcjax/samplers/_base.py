"""The interface of a sampler: from a pixel and the number of a sample to a point."""

import abc
import dataclasses
from dataclasses import field
from typing import Any, NamedTuple, Self

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree, jit, listing

FEW = 8
"""Up to so many coordinates are computed one by one; more in arrays or loops, which compile much faster."""


class Fits(NamedTuple):
    """The image and the number of samples that a sampler is for."""

    size: tuple[int, int] | None = None
    """Width and height of the image; None for any."""
    spp: int = checks.INDEX_LIMIT
    """Largest number of samples per pixel."""
    exact: bool = False
    """Whether an image must have this number of samples, like one of a net over the whole screen."""
    why: str = "for this sampler"
    """The reason for the number of samples, for error messages."""

    @property
    def limits(self) -> tuple[int, int, int]:
        """Limits of column, row and number of the sample."""
        columns, rows = self.size or (checks.INDEX_LIMIT, checks.INDEX_LIMIT)
        return columns, rows, self.spp

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise unless this is the image size, or any is, and there are so many samples."""
        checks.image_size(width, height)
        spp = checks.integer("spp", spp, 1, checks.INDEX_LIMIT)
        if self.size not in (None, (width, height)):
            wanted = "{} x {}".format(*self.size)
            raise ValueError(f"width, height must be the sampler's {wanted}, got {width} x {height}")
        if self.exact and spp != self.spp:
            raise ValueError(f"spp must be {self.spp}, {self.why}, got {spp}")
        if spp > self.spp:
            raise ValueError(f"spp must be at most {self.spp} {self.why}, got {spp}")


class Sampler(abc.ABC):
    """A function from pixel and sample to a point.

    Coordinates 0 and 1 of the point are the position inside the pixel, the others are the scene's. Subclasses
    are frozen dataclass pytrees that implement ``dims`` and :meth:`points`. They override :meth:`prepare` if
    the samples of a pixel share work, and ``fits`` if they are for one image size or a limited number of
    samples.
    """

    loops = False
    """Whether groups of more than `FEW` coordinates are computed in a loop."""

    __dir__ = listing(
        *("adaptive", "at_frame", "check", "dims", "extended", "fits", "of_pass", "points", "prepare"),
        "split",
    )

    @property
    @abc.abstractmethod
    def dims(self) -> int:
        """Number of dimensions."""

    @property
    def fits(self) -> Fits:
        """The image and the number of samples that the sampler is for: by default any, and 2**32."""
        return Fits()

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        """Return the state shared by all samples of the given pixels, for :meth:`points`.

        Loops over samples, as in :func:`qmcjax.render`, compute it once: XLA does not hoist loop invariants,
        such as the position on a curve, that increase memory.

        Parameters
        ----------
        x, y : uint32 Array, of one shape
            Valid pixels.
        dims : tuple of int, the coordinates that will be used, static

        Returns
        -------
        pytree of Arrays, by default the pixels themselves, ``(x, y)``
        """
        return x, y

    def with_tables(self, dims: tuple[int, ...]) -> "Sampler":
        """Return the same sampler for pixels of its image, with tables of what neighbours share.

        They make :meth:`prepare` faster for many pixels, and take less memory than the points of one sample.
        :func:`qmcjax.render` makes them once for an image on a CPU.

        Parameters
        ----------
        dims : tuple of int, the coordinates that will be used, static

        Returns
        -------
        Sampler
            ``self`` by default.
        """
        return self

    @abc.abstractmethod
    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return the points of one sample of each pixel, without checks.

        Parameters
        ----------
        state : pytree of Arrays, from ``prepare`` for the same ``dims``
        sample : uint32 Array, of the pixels' shape
            Valid numbers of samples.
        dims : tuple of int
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, the pixels' shape + (len(dims),), in [0, 1)
        """

    def consecutive(
        self, state: Any, block: Array, count: int, dims: tuple[int, ...], dtype: DTypeLike
    ) -> list[Array]:
        """Return the samples ``block * count``, ``block * count + 1``, ... of the given pixels.

        For loops over samples that evaluate a few at a time. Samplers override it if consecutive samples of a
        pixel share work.

        Parameters
        ----------
        state, dims, dtype
            As for :meth:`points`.
        block : uint32 Array, of the pixels' shape
        count : int, number of samples

        Returns
        -------
        list of Array, the points of each sample
        """
        first, made = block * np.uint32(count), []
        for i in range(count):
            points = self.points(state, first + np.uint32(i), dims, dtype)
            made.append(matching(points, block.shape, dims, dtype))
        return made

    def unrolled(self, dims: tuple[int, ...]) -> int:
        """Return the best number of samples per iteration for :meth:`consecutive`, a power of two.

        Parameters
        ----------
        dims : tuple of int, the coordinates that will be used

        Returns
        -------
        int
            Larger numbers are faster as long as the compiler vectorises the program.
        """
        return 8 if len(dims) <= 2 else 2

    def up_to(self, spp: int) -> "Sampler":
        """Return a sampler of the same points, optimised for the samples below ``spp``.

        Parameters
        ----------
        spp : int, number of samples, at least 1

        Returns
        -------
        Sampler
            ``self`` by default. Samplers without a fixed number of samples override it if fewer samples run
            faster.
        """
        return self

    def finer(self, count: int) -> "Sampler":
        """Return the sampler of sub-samples: ``self``, unless the number of samples is fixed."""
        return self

    def split(self, dims: tuple[int, ...], count: int) -> "Split":
        """Return a sampler with several sub-samples in some coordinates for each sample of the others.

        Paths that split, as from one camera ray to several points of a light, save the rays before [1]_.

        Parameters
        ----------
        dims : tuple of int
            The coordinates to split, static; keep those that belong together, such as pairs, together.
        count : int
            Sub-samples of a sample, at least 1, within the limits of the sampler: a power of two for
            :func:`z`, :func:`optimized`, :func:`designed` and :func:`tiled`, any number for others.

        Returns
        -------
        Split
            Sample ``s * count + k`` is sub-sample k of sample s: in ``dims`` sample ``s * count + k`` of the
            same kind of sampler with ``count`` times as many samples, else, to the bit, sample s of this one.
            It can be split again. :func:`qmcjax.render` splits by names and evaluates what is shared once.

        Raises
        ------
        ValueError
            If the sampler cannot have so many samples, as a net over the whole screen.

        Notes
        -----
        Coordinates that are split and others are together as uniform over keys as without splitting, and as
        independent in an image. Tiles of sub-samples have translations and turns of their own, like those of
        further coordinates; :func:`optimized` keeps its map from three dimensions on. In two-dimensional
        nets, the ``2**k`` sub-samples of each sample are a net, too; for :func:`z` only if it has a power of
        four as spp.

        References
        ----------
        .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
           Hierarchical Ordering of Pixels", 2020, Sect. 4.4.

        Examples
        --------
        >>> from qmcjax import samplers
        >>> sampler = samplers.z(8, 8, spp=1, key=1, dims=4)
        >>> print(sampler.split((2, 3), 4)(3, 5, 2, dims=(0, 1)) == sampler(3, 5, 0, dims=(0, 1)))
        [ True  True]
        """
        count = checks.integer("count", count, 1, checks.INDEX_LIMIT - 1)
        return Split(self, self.finer(count), checks.dimensions(dims, self.dims), count)

    def at_frame(self, frame: Array | int) -> Self:
        """Return the sampler of another frame of an animation, without recompilation.

        Parameters
        ----------
        frame : int, or integer Array of shape (), in [0, 2**32)
            For an order of pixels and frames, below its padded number of frames.

        Raises
        ------
        TypeError
            If the sampler was not made with frames: by ``frames=``, with a sequence of
            :func:`qmcjax.sequences.in_time`, or along an order of pixels and frames.
        """
        own: Any = self._in_time()
        parts = {each.name: getattr(own, each.name) for each in dataclasses.fields(own)}
        moved = {name: part.at_frame(frame) for name, part in parts.items() if hasattr(part, "at_frame")}
        if parts.get("frame") is not None:
            moved["frame"] = checks.frame(frame)
        if not moved:
            raise TypeError(
                "sampler must be made with frames (frames=..., a sequence by sequences.in_time, or an order "
                f"of pixels and frames), got {checks.shown(self)}"
            )
        return dataclasses.replace(own, **moved)

    def _in_time(self) -> Self:
        """Return the sampler with a part that moves: a ``frame``, or an object with ``at_frame``."""
        return self

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise unless the sampler supports this image size and number of samples, as ``fits`` says.

        Parameters
        ----------
        width, height : int, in [1, 65536]
        spp : int, samples of each pixel, at least 1
        """
        self.fits.check(width, height, spp)

    def __call__(
        self,
        x: Array | int,
        y: Array | int,
        sample: Array | int,
        dims: tuple[int, ...] | None = None,
        dtype: DTypeLike = jnp.float32,
    ) -> Array:
        """Return the points of the given pixels and samples.

        Parameters
        ----------
        x, y, sample : integer Array, broadcastable, or int
            Column, row, and number of the sample in the pixel. Traced values are not checked.
        dims : tuple of int, optional
            The coordinates to compute, static. All by default.
        dtype : float32 or float64

        Returns
        -------
        Array of ``dtype``, the broadcast shape + (len(dims),), in [0, 1)
        """
        wanted, dtype = checks.dimensions(dims, self.dims), checks.floating(dtype)
        named = zip(("x", "y", "sample"), (x, y, sample), self.fits.limits, strict=True)
        x, y, sample = jnp.broadcast_arrays(*(checks.unsigned(*argument) for argument in named))
        sampler = self
        if not isinstance(sample, Tracer):
            sampler = self.up_to(int(np.max(np.asarray(sample), initial=0)) + 1)
        if self.loops and len(wanted) > FEW:  # Step by step, each loop would be compiled in each call.
            with checks.precision(dtype):
                points = _compiled(sampler, x, y, sample, wanted, dtype)
        else:
            points = sampler.points(sampler.prepare(x, y, wanted), sample, wanted, dtype)
        return matching(points, x.shape, wanted, dtype)


def _points(
    sampler: Sampler, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: DTypeLike
) -> Array:
    return sampler.points(sampler.prepare(x, y, dims), sample, dims, dtype)


_compiled = jit("dims", "dtype")(_points)


@frozen_pytree
class Split(Sampler):
    """Sample s has the split coordinates of sample s of ``fine``, the others of sample ``s // count``."""

    whole: Sampler
    fine: Sampler
    divided: tuple[int, ...] = field(metadata={"static": True})
    count: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.whole.dims

    @property
    def fits(self) -> Fits:
        return self.fine.fits

    @property
    def loops(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.whole.loops or self.fine.loops

    def _parts(self, dims: tuple[int, ...]) -> list[tuple[Sampler, tuple[int, ...], int]]:
        """Return samplers, which of the coordinates they have, and for how many samples."""
        split = tuple(j for j in dims if j in self.divided)
        kept = tuple(j for j in dims if j not in split)
        return [part for part in ((self.whole, kept, self.count), (self.fine, split, 1)) if part[1]]

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        return [sampler.prepare(x, y, own) for sampler, own, _ in self._parts(dims)]

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        made, order = [], ()
        for (sampler, own, count), prepared in zip(self._parts(dims), state, strict=True):
            made.append(sampler.points(prepared, sample // np.uint32(count), own, dtype))
            order += own
        return joined(made, order, dims)

    def up_to(self, spp: int) -> "Split":
        whole, fine = self.whole.up_to(-(-spp // self.count)), self.fine.up_to(spp)
        return Split(whole, fine, self.divided, self.count)

    def finer(self, count: int) -> Sampler:
        return self.fine.finer(count)

    def check(self, width: int, height: int, spp: int) -> None:
        self.fine.check(width, height, spp)


def matching(points: Any, shape: tuple[int, ...], dims: tuple[int, ...], dtype: DTypeLike) -> Array:
    """Return the points of a sampler, or raise a ValueError unless there is one point per pixel."""
    wanted = (*shape, len(dims))
    if getattr(points, "shape", None) != wanted or points.dtype != dtype:
        what = f"{points.dtype} {points.shape}" if hasattr(points, "dtype") else checks.shown(points)
        raise ValueError(
            f"sampler must return points of shape {wanted} and dtype {np.dtype(dtype)} for {len(dims)} "
            f"coordinates, got {what}"
        )
    return points


def joined(parts: list[Array], order: tuple[int, ...], dims: tuple[int, ...]) -> Array:
    """Return coordinates side by side, as ``dims``, from parts that have them in another order."""
    whole = parts[0] if len(parts) == 1 else jnp.concatenate(parts, axis=-1)
    return whole if order == dims else whole[..., np.array([order.index(j) for j in dims])]


def more_samples(spp: int, count: int, most: int, powers: bool = False) -> int:
    """Return ``spp * count``, or raise a ValueError if it is above ``most`` or must be a power of two."""
    if spp * count > most or (powers and count & (count - 1)):
        kind = "a power of two, " if powers else ""
        raise ValueError(f"count must be {kind}at most {most // spp} for spp={spp}, got {count}")
    return spp * count
