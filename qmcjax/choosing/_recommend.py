"""The choice of a sampler from measured errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jax import Array

from qmcjax.choosing._candidates import CANDIDATES, MOST
from qmcjax.choosing._table import LEVELS, MEASURES, SIZES, SPPS, ErrorRatio, Measured, has_edges
from qmcjax.core import checks
from qmcjax.samplers import Sampler
from qmcjax.scenes import as_scene

USUAL = "(0,2), Owen"
"""The default for comparison: independent points in each pixel."""


@dataclass(frozen=True)
class Recommendation:
    """A sampler, the reason, and the errors of the others relative to it; see :func:`recommend`."""

    name: str
    """Name of the sampler, as in plots."""
    dims: int
    spp: int
    reason: str
    """The reason, in a few sentences with numbers."""
    others: Mapping[str, ErrorRatio]
    """Errors of all other samplers relative to this one, the best first."""

    def sampler(self, width: int, height: int, key: Array | int) -> Sampler:
        """Make the sampler.

        Parameters
        ----------
        width, height : int, in [1, 65536]
        key : jax.random.key, or int in [0, 2**32)

        Returns
        -------
        Sampler, for ``spp`` samples per pixel and ``dims`` dimensions

        Raises
        ------
        ValueError
            If the sampler is a permutation net and the image needs more than 2**32 samples: take one of the
            ``others``.
        """
        width, height = checks.image_size(width, height)
        return CANDIDATES[self.name].make(self.dims, width, height, self.spp, checks.prng_key("key", key))

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Samplers that are not significantly worse by 2 % at each measured size."""
        return tuple(name for name, other in self.others.items() if not other.differs)

    @property
    def margin(self) -> ErrorRatio | None:
        """Error ratio of the best sampler that differs significantly; None if there is none."""
        return next((other for other in self.others.values() if other.differs), None)


def recommend(needs: Any, spp: int, smooth: bool | None = None, *, filtered: bool = False) -> Recommendation:
    """Return the sampler with the least measured error for scenes of a kind, and its margin.

    Parameters
    ----------
    needs : Scene, tuple of str, or int
        A scene, the names of its dimensions (``scene.needs``), or how many there are, in [2, 250]. The scene
        is never evaluated.
    spp : int, samples per pixel, in [1, 2**31]
    smooth : bool, optional
        Whether values have no jumps within pixels, in any dimension. By default known from the type of the
        scene; otherwise scenes of both kinds count.
    filtered : bool
        Minimise the error after a Gaussian filter of 1.5 pixels, as for viewing at a distance or before a
        denoiser, rather than the RMS error of pixels.

    Notes
    -----
    Errors were measured on images of 128 x 128 and of 100 x 76 pixels, of the scenes of this package that are
    not ray-traced, each as root mean square over 8 keys, in levels of 2, of 3 and 4, and of 5 to 8
    dimensions, at 1, 4, 16 and 64 samples per pixel. Between these, logarithms of errors are interpolated
    over the logarithm of the number of samples: this may be too optimistic for other numbers than powers of
    two. Beyond, the nearest measurement counts, and ``reason`` says so. Intervals of geometric means over
    scenes are Student's t intervals, from the lowest to the highest end at both sizes. They hold the mean of
    such scenes with these keys: for samplers with one sequence over the whole image, eight other keys move
    them by up to a third. For single scenes ``reason`` gives the least and the largest measured ratio. All
    pairs of samplers are compared together by Holm's procedure: with 95 % confidence, every sampler called
    worse is worse. Run times are not counted.

    Examples
    --------
    >>> import qmcjax as qj
    >>> from qmcjax import scenes
    >>> choice = qj.recommend(scenes.disc(), spp=16)
    >>> choice.dims, choice.margin.low > 1.02, len(choice.reason) > 100
    (2, True, True)
    >>> image = qj.render(scenes.disc(), choice.sampler(64, 64, key=1), 64, 64, spp=16)
    """
    dims, edges = _asked(needs)
    spp = checks.integer("spp", spp, 1, 2**31)
    if smooth is not None:
        edges = not checks.flag("smooth", smooth)
    filtered = checks.flag("filtered", filtered)
    level = next((level for level in LEVELS if dims <= level), max(LEVELS))
    measured = Measured.of(edges, level, spp, filtered)
    names = measured.ranked(name for name, made in CANDIDATES.items() if made.takes(dims, spp))
    best, others = names[0], dict(zip(names[1:], measured.ratios(names)[1:], strict=True))
    reason = _reason(best, others, measured, edges, level, spp, filtered)
    beyond = f" Scenes of more than {level} dimensions were not measured." if dims > level else ""
    return Recommendation(best, dims, spp, reason + beyond, others)


def _asked(needs: Any) -> tuple[int, bool | None]:
    """Return the number of dimensions, and whether there are edges if that is known."""
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


def _reason(
    best: str,
    others: Mapping[str, ErrorRatio],
    measured: Measured,
    edges: bool | None,
    level: int,
    spp: int,
    filtered: bool,
) -> str:
    """Return the comparison and its result in words."""
    kind = "scenes" if edges is None else "scenes with edges" if edges else "smooth scenes"
    sizes = " and ".join(f"{width} x {height}" for width, height in SIZES)
    alike = [f'"{name}"' for name, other in others.items() if not other.differs]
    said = (
        f"On {len(measured.scenes)} {kind} in {LEVELS[level]} at {spp} spp{_between(spp)}, in images of "
        f'{sizes} pixels, "{best}" has the least {MEASURES[filtered]} of {1 + len(others)} samplers'
    )
    if len(alike) == len(others):
        return f"{said}, but there is no certain difference: none has certainly 2 % more at both sizes."
    if alike:
        said += f"; there is no certain difference to {', '.join(alike)}"
    name, margin = next((name, other) for name, other in others.items() if other.differs)
    single = np.exp(measured.errors[name] - measured.errors[best])
    said += f'; "{name}" has {margin} times that, {single.min():.2f} to {single.max():.2f} on single scenes'
    if USUAL in others and USUAL != name and others[USUAL].differs:
        said += f', "{USUAL}" in each pixel {others[USUAL]}'
    return said + "."


def _between(spp: int) -> str:
    """Return in words how a number of samples relates to the measured ones."""
    if spp in SPPS:
        return ""
    if spp > SPPS[-1]:
        return f" (measured up to {SPPS[-1]})"
    low = max(each for each in SPPS if each < spp)
    high = min(each for each in SPPS if each > spp)
    return f" (interpolated between {low} and {high})"
