"""The interface of a sampler: from a pixel and the number of a sample to a point."""

import abc
from dataclasses import field
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree, listing


class Sampler(abc.ABC):
    """A function from pixel and sample to a point.

    Coordinates 0 and 1 of the point are the position inside the pixel, the others are the scene's. Subclasses
    are frozen dataclass pytrees that implement ``dims`` and :meth:`points`. They override :meth:`prepare` if
    the samples of a pixel share work, ``limits`` if the number of samples is limited, and :meth:`check` if
    they are made for one image size.
    """

    _limited = "for this sampler"
    """Reason for the limit on the number of samples, for error messages."""

    __dir__ = listing(
        *("adaptive", "at_frame", "check", "dims", "extended", "height", "limits", "of_pass", "points"),
        *("prepare", "split", "spp", "width"),
    )

    @property
    @abc.abstractmethod
    def dims(self) -> int:
        """Number of dimensions."""

    @property
    def limits(self) -> tuple[int, int, int]:
        """Largest numbers of columns, rows, and samples per pixel: 2**32 each by default."""
        return checks.INDEX_LIMIT, checks.INDEX_LIMIT, checks.INDEX_LIMIT

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

    def check(self, width: int, height: int, spp: int) -> None:
        """Raise unless the sampler supports this image size and number of samples.

        Parameters
        ----------
        width, height : int, in [1, 65536]
        spp : int, samples of each pixel, at least 1
        """
        checks.image_size(width, height)
        self._check_count(checks.integer("spp", spp, 1, checks.INDEX_LIMIT))

    def _check_count(self, spp: int, limit: int | None = None) -> None:
        """Raise if ``spp`` exceeds the number of samples, by default that of ``limits``."""
        limit = self.limits[2] if limit is None else limit
        if spp > limit:
            raise ValueError(f"spp must be at most {limit} {self._limited}, got {spp}")

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
        x, y, sample = self._checked(x, y, sample)
        sampler = self
        if not isinstance(sample, Tracer):
            sampler = self.up_to(int(np.max(np.asarray(sample), initial=0)) + 1)
        points = sampler.points(sampler.prepare(x, y, wanted), sample, wanted, dtype)
        return matching(points, x.shape, wanted, dtype)

    def _checked(self, x: Array | int, y: Array | int, sample: Array | int) -> tuple[Array, Array, Array]:
        named = zip(("x", "y", "sample"), (x, y, sample), self.limits, strict=True)
        x, y, sample = jnp.broadcast_arrays(*(checks.unsigned(*argument) for argument in named))
        return x, y, sample


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
    def limits(self) -> tuple[int, int, int]:
        return self.fine.limits

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

    def _checked(self, x: Array | int, y: Array | int, sample: Array | int) -> tuple[Array, Array, Array]:
        return self.fine._checked(x, y, sample)


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
