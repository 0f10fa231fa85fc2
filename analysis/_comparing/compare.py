"""Comparison of samplers: perceived errors, their spectra, and run time."""

import itertools
import statistics
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import _arguments
from analysis._comparing.comparison import MEASURES, Comparison, ComparisonRow, Measure
from analysis._comparing.convergence import time_render
from analysis._comparing.makers import Maker, validate_named, validate_spps
from analysis._comparing.promises import error_line
from analysis._discrepancy.star_discrepancy import star_discrepancy
from analysis._distances.distance import min_distance, packing_distance
from analysis._structure.nets import t_value
from qmcjax.core import checks
from qmcjax.rendering import render
from qmcjax.samplers import Sampler, SamplerLike
from qmcjax.scenes import Scene, as_scene

_BLOCK = 16
"""Side in pixels of the square whose points are measured together."""

_MOST_POINTS = 2**14

_TIMED = 3
"""Renderings whose median is the time of an image."""


def compare(
    samplers: Mapping[str, SamplerLike | Callable[..., SamplerLike]],
    scenes: Mapping[str, Scene],
    spps: Iterable[int] = (1, 4, 16, 64),
    *,
    width: int = 128,
    height: int = 128,
    keys: int = 8,
    measures: Mapping[str, Measure] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Render scenes with samplers, and measure errors, points and run time.

    Parameters
    ----------
    samplers : mapping of names to samplers
        Each is a sampler, or a function that makes one; its parameters are any of ``width``, ``height``,
        ``spp`` and ``key`` (an int). Without ``key`` it is rendered once, without confidence intervals.
    scenes : mapping of names to scenes, with a ``reference(width, height)``
    spps : iterable of int, different numbers of samples per pixel
    width, height : int, size of the images in pixels, at least 32
    keys : int
        Number of images, with keys 0, 1, ... Fewer than 4 give neither intervals nor ranks.
    measures : mapping of names to functions, optional
        Further measures, from an image and its reference, float64 arrays, to a number of at least 0, the
        smaller the better: :func:`relative_error`, :func:`trimmed_error`, :func:`quantile_error`,
        :func:`flip`, :func:`denoised_error` with a denoiser, or your own. Rows, ranks, slopes and tables have
        them under their names, with intervals over keys.
    progress : callable, optional, called with the finished fraction in (0, 1]

    Returns
    -------
    Comparison
        Samplers that have too few dimensions for a scene, do not support a number of samples, or fail, are
        omitted there; ``left_out`` gives the reason. Failures are also listed in ``promises``.

    Notes
    -----
    Measures of points are the star discrepancy and the toroidal minimum distance of the points in the square
    of the first 16 x 16 pixels, the distance relative to the largest possible one for this number of points,
    and the largest t of the points in each of these pixels as nets, if their number is a power of 2.

    Examples
    --------
    >>> from qmcjax import samplers, scenes, sequences
    >>> def owen(key):
    ...     return samplers.independent(sequences.sobol(2), key)
    >>> def random(width, height, key):
    ...     return samplers.independent(sequences.uniform(2, key), key, "shift")
    >>> made = {"Owen": owen, "random": random}
    >>> from analysis import trimmed_error
    >>> more = {"trimmed": trimmed_error}
    >>> result = compare(made, {"disc": scenes.disc()}, [16], width=32, height=32, measures=more)
    >>> result.ranks("disc", 16)
    {'Owen': (1, 1, 1), 'random': (2, 2, 2)}
    >>> result.ranks("disc", 16, "trimmed")
    {'Owen': (1, 1, 1), 'random': (2, 2, 2)}
    """
    width, height = checks.image_size(width, height)
    for name, size in (("width", width), ("height", height)):
        # Below, there are no low frequencies.
        checks.integer(name, size, 32, 2**16)
    keys = checks.integer("keys", keys, 1, 2**16)
    spps = validate_spps(spps)
    validate_named("samplers", samplers)
    validate_named("scenes", scenes)
    checks.progress(progress)
    worlds = {name: as_scene(f"scenes[{name!r}]", scene) for name, scene in scenes.items()}
    for name, scene in worlds.items():
        if not callable(getattr(scene, "reference", None)):
            raise TypeError(
                f"scenes[{name!r}] must have a reference(width, height), got {checks.shown(scene)}"
            )
    makers = {name: Maker(name, made, width, height, keys) for name, made in samplers.items()}
    references = {
        name: np.asarray(scene.reference(width, height)[0], np.float64) for name, scene in worlds.items()
    }
    measures = _checked_measures(measures, references)
    promises = {name: maker.broken(max(spps)) for name, maker in makers.items()}
    points: dict[str, dict[int, dict[str, float]]] = {name: {} for name in makers}
    rows, left_out = [], {}
    plan = [(name, spp, scene) for name in makers for spp in spps for scene in worlds]
    for done, (name, spp, scene) in enumerate(plan, start=1):
        maker, needed = makers[name], len(worlds[scene].needs)
        try:
            sampler = maker(spp, 0)
            sampler.check(width, height, spp)
        except Exception as error:
            left_out[scene, name, spp] = error_line(error)
        else:
            try:
                if sampler.dims < needed:
                    left_out[scene, name, spp] = f"it has {sampler.dims} dimensions, the scene needs {needed}"
                else:
                    rows.append(_row(scene, worlds[scene], maker, spp, references[scene], measures))
                if spp not in points[name]:
                    points[name][spp] = _of_points(sampler, min(width, height, _BLOCK), spp)
            except Exception as error:
                if str(error).startswith("scene must"):
                    raise
                left_out[scene, name, spp] = why = error_line(error)
                promises[name] = promises[name] or [f"rendering {scene} with {spp} samples fails: {why}"]
        if progress is not None:
            progress(done / len(plan))
    places = list(worlds)
    rows.sort(key=lambda row: places.index(row.scene))
    return Comparison(tuple(rows), points, promises, left_out, references, dict(makers))


def _checked_measures(measures: Any, references: Mapping[str, NDArray]) -> Mapping[str, Measure]:
    """Return measures; raise unless they are functions that measure the references themselves."""
    if measures is None:
        return {}
    validate_named("measures", measures, "functions of an image and its reference")
    for name, of in measures.items():
        if name in MEASURES:
            raise ValueError(f"measures must have names other than {', '.join(MEASURES)}, got {name!r}")
        checks.function(f"measures[{name!r}]", of, "of an image and its reference", 2)
        for reference in references.values():
            _arguments.not_negative(f"measures[{name!r}](image, reference)", of(reference, reference))
    return measures


def _row(
    name: str, scene: Any, maker: Maker, spp: int, reference: NDArray, measures: Mapping[str, Measure]
) -> ComparisonRow:
    height, width = reference.shape[:2]
    sampler = maker(spp, 0)
    first = np.asarray(render(scene, sampler, width, height, spp))
    # The same object, since another one may recompile.
    seconds = [time_render(scene, sampler, width, height, spp)[0] for _ in range(_TIMED)]
    others = (np.asarray(render(scene, maker(spp, key), width, height, spp)) for key in range(1, maker.keys))
    images = itertools.chain([first], others)
    return ComparisonRow.of_images(
        name, maker.name, spp, images, reference, statistics.median(seconds), measures
    )


def _of_points(sampler: Sampler, side: int, spp: int) -> dict[str, float]:
    """Return measures of the points of the first pixels, in their square."""
    side = min(side, max(1, int((_MOST_POINTS / spp) ** 0.5)))
    spp = min(spp, _MOST_POINTS)
    y, x, sample = np.indices((side, side, spp), np.uint32)
    own = np.asarray(sampler(x, y, sample, (0, 1)), np.float64)
    together = ((own + np.stack([x, y], axis=-1)) / side).reshape(-1, 2)
    together = np.minimum(together, np.nextafter(1, 0))
    n = len(together)
    measured = {"star discrepancy": star_discrepancy(together)}
    if n > 1:
        measured["relative minimum distance"] = min_distance(together) / packing_distance(n, 2)
    if spp > 1 and spp & (spp - 1) == 0:
        pixels = own[:4, :4].reshape(-1, spp, 2)
        measured["largest t in a pixel"] = float(max(t_value(each) for each in pixels))
    return measured
