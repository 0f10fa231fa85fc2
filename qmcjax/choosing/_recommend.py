"""The choice of a sampler from measured errors."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax import Array

from qmcjax import scenes
from qmcjax.choosing._candidates import MOST
from qmcjax.choosing._table import (
    ANIMATED,
    DENOISED,
    KINDS,
    LEVELS,
    MEASURES,
    USES,
    ErrorRatio,
    Measured,
    has_edges,
)
from qmcjax.core import checks
from qmcjax.samplers import Sampler
from qmcjax.scenes import Scene, as_scene


@dataclass(frozen=True)
class Recommendation:
    """A sampler, the reason, and the errors of the others relative to it; see :func:`recommend`."""

    name: str
    """Name of the sampler, as in plots."""
    dims: int
    spp: int
    reason: str
    """The reason in two sentences, wrapped to lines of at most 80 characters."""
    cost: float
    """Worst case of the choice: the largest ratio, over the measured scenes of this kind, of its error to the
    smallest error of any sampler."""
    others: Mapping[str, ErrorRatio]
    """Errors of all other samplers relative to this one, best first."""
    setting: str = "images"
    """The use: "images", "frames", "prefixes" or "denoised"."""

    def __str__(self) -> str:
        return f"{self.name}\n{self.reason}\n{_wrapped(_COST.format(self.cost))}"

    def sampler(self, width: int, height: int, key: Array | int, frame: Array | int | None = None) -> Sampler:
        """Make the sampler.

        Parameters
        ----------
        width, height : int, in [1, 65536]
        key : jax.random.key, or int in [0, 2**32)
        frame : int, or integer Array of shape (), in [0, 2**32)
            Number of the frame, only for animations; use one key for all frames. A new frame does not
            recompile.

        Returns
        -------
        Sampler, for ``spp`` samples per pixel and ``dims`` dimensions

        Raises
        ------
        ValueError
            If the sampler is a permutation net and the image needs more than 2**32 samples: use one of the
            ``others``.
        """
        width, height = checks.image_size(width, height)
        setting, key = USES[self.setting], checks.prng_key("key", key)
        if (frame is None) != (setting is not ANIMATED):
            wanted = "the number of a frame" if setting is ANIMATED else "None without frames="
            raise ValueError(f"frame must be {wanted}, got {checks.shown(frame)}")
        of_frame = () if frame is None else (checks.unsigned("frame", frame),)
        return setting.candidates[self.name].make(self.dims, width, height, self.spp, key, *of_frame)

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Samplers that are not significantly worse, by 2 %, at each measured size."""
        return tuple(name for name, other in self.others.items() if not other.differs)

    @property
    def margin(self) -> ErrorRatio | None:
        """Error ratio of the best significantly different sampler, or None."""
        return next((other for other in self.others.values() if other.differs), None)


def recommend(
    needs: Scene | tuple[str, ...] | int,
    spp: int,
    smooth: bool | None = None,
    *,
    filtered: bool = False,
    frames: int | None = None,
    progressive: bool = False,
    size: tuple[int, int] | None = None,
    after: str | None = None,
) -> Recommendation:
    """Return the sampler with the smallest measured error for a kind of scene, and its margin.

    Parameters
    ----------
    needs : Scene, tuple of str, or int
        A scene, the names of its dimensions (``scene.needs``), or their number, in [2, 250]. The scene is
        never evaluated.
    spp : int, samples per pixel, in [1, 2**31]
    smooth : bool, optional
        Whether values have no jumps within pixels, in any dimension. By default this follows from the type of
        the scene; for unknown types, scenes of both kinds count.
    filtered : bool
        Minimise the error after a Gaussian filter of 1.5 pixels, as seen from a distance, rather than the RMS
        error of pixels.
    frames : int, optional
        For an animation of so many frames, seen through a temporal filter: a moving average with weight 1/10
        for each new frame. ``sampler(width, height, key, frame)`` makes the sampler of each frame.
    progressive : bool
        For an image that is shown while it is rendered: minimise the geometric mean of the errors of its
        first 1, 2, 4, ... of ``spp`` samples, among samplers whose first samples cover both halves of each
        coordinate in every image. Not with ``frames``.
    size : (int, int), optional
        Width and height of the image. Only errors of similar images count: squares with a power of 2 as side,
        or all others. By default both kinds count.
    after : {"nothing", "filter", "denoiser"}, optional
        What comes after the image: the filter is that of ``filtered``, the denoiser Open Image Denoise, for
        which scenes of both kinds and one size count. Not with ``filtered``; a denoiser also not with
        ``frames`` or ``progressive``.

    Notes
    -----
    Errors were measured on images of 128 x 128 and of 100 x 76 pixels, of the scenes of this package that are
    not ray-traced, as root mean squares over 8 keys, in groups of 2, of 3 and 4, and of 5 to 8 dimensions, at
    1, 4, 16 and 64 samples per pixel. In between, the logarithm of the error is interpolated linearly in the
    logarithm of the number of samples, which may be too optimistic for numbers that are not powers of two.
    Beyond, the nearest measurement counts, and ``reason`` says so. Intervals of geometric means over scenes
    are Student's t intervals, from the lowest to the highest end at both sizes. They contain the mean over
    such scenes with these keys: for samplers with one sequence over the whole image, eight other keys shift
    it by up to a third. All pairs of samplers are compared simultaneously by Holm's procedure: with 95 %
    confidence, every sampler called worse is worse. Run times are not considered.

    Animations and progressive images were measured on images of 64 x 64 and of 50 x 38 pixels with 4 keys,
    animations with 32 frames of a still scene at 1 and 4 samples: the tables do not include motion.

    Errors after a denoiser were measured by the figure ``denoisers`` in images of 128 x 128 pixels, at 1, 4
    and 16 samples per pixel: with 16 keys in eight ray-traced scenes, of which some in the last group have
    more than eight dimensions, and with 8 keys in each class of flat fields, which are half-spaces, balls,
    bumps and products in two and four dimensions.

    Examples
    --------
    >>> import qmcjax as qj
    >>> from qmcjax import scenes
    >>> choice = qj.recommend(scenes.disc(), spp=16)
    >>> print(choice)
    designed tiles
    It has the least RMS error of 17 samplers on 9 scenes with edges in 2 dimensions
    at 16 spp. "random" has 2.53 times this error (1.74 to 3.75); 15 others are not
    significantly worse.
    On single scenes it has at most 1.66 times the error of the best sampler there.
    >>> image = qj.render(scenes.disc(), choice.sampler(64, 64, key=1), 64, 64, spp=16)
    """
    dims, edges = _asked(needs)
    spp = checks.integer("spp", spp, 1, 2**31)
    if smooth is not None:
        edges = not checks.flag("smooth", smooth)
    filtered = checks.flag("filtered", filtered)
    progressive = checks.flag("progressive", progressive)
    if frames is not None:
        checks.integer("frames", frames, 1, checks.INDEX_LIMIT)
        if progressive:
            raise ValueError("progressive must be False for frames, got True")
    if size is not None:
        size = _checked_size(size)
    name = "prefixes" if progressive else "images" if frames is None else "frames"
    if after is not None:
        after = checks.choice("after", after, ("nothing", "filter", "denoiser"))
        if filtered:
            raise ValueError(f"filtered must be False with after={after!r}, got True")
        filtered = after == "filter"
    if after == "denoiser":
        if name != "images":
            raise ValueError('after must be "nothing" or "filter" for frames or progressive, got "denoiser"')
        name, edges, size = "denoised", None, None
    setting = USES[name]
    level = next((level for level in LEVELS if dims <= level), max(LEVELS))
    measured = Measured.of(edges, level, spp, filtered, setting, size)
    able = (name for name, made in setting.candidates.items() if made.takes(dims, spp))
    names = measured.ranked(able)
    best, others = names[0], dict(zip(names[1:], measured.ratios(names)[1:], strict=True))
    kind = "scenes" if edges is None else KINDS[edges]
    beyond = " (more were not measured)" if dims > level else ""
    where = f"{kind} in {LEVELS[level]}{beyond} at {spp} spp{_between(spp, setting.spps)}"
    why = (
        f"It has the least {MEASURES[filtered]}{setting.errors} of {len(names)} samplers on "
        f"{len(measured.scenes)} {where}. {_differences(others)}"
    )
    if setting is not DENOISED and isinstance(needs, scenes.Traced):
        why += " None of these scenes is ray-traced."
    least = np.min([measured.errors[name] for name in names], axis=0)
    cost = float(np.exp((measured.errors[best] - least).max()))
    return Recommendation(best, dims, spp, _wrapped(why), cost, others, name)


def _checked_size(size: Any) -> tuple[int, int]:
    pair = isinstance(size, tuple | list) or (isinstance(size, np.ndarray) and size.ndim == 1)
    if not pair or len(size) != 2:
        raise TypeError(f"size must be a width and a height, got {checks.shown(size)}")
    width, height = (checks.integer("size", each, 1, checks.MAX_SIDE) for each in size)
    return width, height


def _asked(needs: Any) -> tuple[int, bool | None]:
    """Return the number of dimensions, and whether there are edges, if known."""
    named = isinstance(needs, tuple | list) and all(isinstance(each, str) for each in needs)
    if named or not callable(needs):
        if not named and not hasattr(needs, "__index__"):
            raise TypeError(
                "needs must be a scene, the names of its dimensions or how many there are, got "
                f"{checks.shown(needs)}"
            )
        return checks.integer("needs", len(needs) if named else needs, 2, MOST), None
    scene = as_scene("needs", needs)
    return checks.integer("the number of dimensions of needs", len(scene.needs), 2, MOST), has_edges(scene)


_COST = "On single scenes it has at most {:.2f} times the error of the best sampler there."


def _wrapped(text: str) -> str:
    return "\n".join(textwrap.wrap(text, 80))


def _differences(others: Mapping[str, ErrorRatio]) -> str:
    """Return a sentence on which differences are significant."""
    alike = sum(not other.differs for other in others.values())
    if alike == len(others):
        return "No difference to another sampler is significant."
    name, margin = next((name, other) for name, other in others.items() if other.differs)
    said = f'"{name}" has {margin.ratio:.2f} times this error ({margin.low:.2f} to {margin.high:.2f})'
    if alike:
        said += f"; {alike} {'others are' if alike > 1 else 'other is'} not significantly worse"
    return f"{said}."


def _between(spp: int, spps: tuple[int, ...]) -> str:
    """Describe how a number of samples relates to the measured ones."""
    if spp in spps:
        return ""
    if spp > spps[-1]:
        return f" (measured up to {spps[-1]})"
    low = max(each for each in spps if each < spp)
    high = min(each for each in spps if each > spp)
    return f" (interpolated between {low} and {high})"
