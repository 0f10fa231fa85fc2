"""Error and run time of samplers against the number of samples."""

from __future__ import annotations

import itertools
import json
import math
import os
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import NDArray

from analysis import _arguments
from analysis._comparing.convergence_table import ConvergenceRow, ConvergenceTable, geometric_mean
from analysis._comparing.makers import Maker, validate_named, validate_spps
from qmcjax.core import checkpoints, checks, devices
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.rendering import render
from qmcjax.samplers import Sampler, SamplerLike, as_sampler
from qmcjax.scenes import Scene, as_scene


def convergence(
    scene: Scene,
    samplers: Mapping[str, SamplerLike | Callable[..., SamplerLike]],
    spps: Iterable[int],
    *,
    width: int = 128,
    height: int = 128,
    regions: Mapping[str, Any] | None = None,
    keys: int | None = None,
    repeats: int = 3,
    reference: tuple[Any, Any] | None = None,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    mesh: Mesh | None = None,
) -> ConvergenceTable:
    """Render a scene with each sampler and number of samples, and measure error and time.

    The error is ``sqrt(mean((I - I_ref)**2))`` over the values of a region. This is the norm of [1]_,
    ``||I - I_ref||_2``, divided by the square root of their number, to be independent of the resolution. The
    reference is computed once.

    Parameters
    ----------
    scene : Scene
        Needs a ``reference(width, height)``, unless ``reference`` is given.
    samplers : mapping of names to samplers
        Each is a Sampler, or a function from the samples per pixel to one, since nets and contiguous samplers
        are made for one number of samples. With ``keys``, a function has any of the parameters ``width``,
        ``height``, ``spp`` and ``key`` (an int), as for :func:`compare`.
    spps : iterable of int, different numbers of samples per pixel, at least 1
    width, height : int, in [1, 65536]
    regions : mapping of names to numpy indices, optional
        Selections from an image of shape (height, width), such as ``numpy.s_[:64, 32:]`` or a mask. By
        default the "whole" image, and its "upper" and "lower" half: the first ``height // 2`` rows and the
        rest.
    keys : int, optional
        At least 1. If given, images are rendered with keys 0, 1, ... for each sampler that is a function of
        ``key``: errors are geometric means over keys, and errors and slopes have intervals if there are 4 or
        more. All other samplers are rendered once.
    repeats : int
        Number of renderings for the median time, after the first one.
    reference : (image, bound), optional
        Replaces the reference of the scene: an image of shape (height, width) or (height, width, 3), and one
        bound on the errors of its values, or an array of bounds, as from :func:`qmcjax.estimated_reference`.
    progress : callable, optional, called with the finished fraction in (0, 1] after each row
    checkpoint : path or Checkpoint, optional
        A file for the finished rows, written every half minute. Calling the function again with the
        same arguments resumes from it, with the times measured before. The file is not deleted. With foreign
        code, pass a :class:`qmcjax.Checkpoint` with a label.
    mesh : jax.sharding.Mesh, optional
        Devices, as in :func:`qmcjax.render`. All its processes make the same call and share the rows; the
        devices of a process share the pixels of an image. Each process gets all rows. The time of an image is
        measured in its process, while the others render other images.

    Raises
    ------
    TypeError
        Also if the scene has no reference and none is given.
    ValueError
        Before rendering, also if a region is empty, a sampler does not support the image size or a number of
        samples, or ``checkpoint`` is damaged or belongs to other arguments, labels or versions.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 6.1.

    Examples
    --------
    >>> from qmcjax import samplers, scenes, sequences
    >>> jittered = samplers.independent(sequences.sobol(2), key=1)
    >>> table = convergence(scenes.checkerboard(), {"Owen": jittered}, [4, 16], width=32, height=32)
    >>> print(table.slope("Owen") < -0.5)
    True

    Over keys, for intervals:

    >>> def owen(key):
    ...     return samplers.independent(sequences.sobol(2), key)
    >>> size = {"width": 32, "height": 32, "regions": {"whole": np.s_[:]}}
    >>> table = convergence(scenes.disc(), {"Owen": owen}, [4, 16], keys=8, **size)
    >>> low, high = table.slope_interval("Owen")
    >>> print(low < -0.5, high - low < 0.2)
    True True
    """
    scene = as_scene("scene", scene)
    width, height = checks.image_size(width, height)
    repeats = checks.integer("repeats", repeats, 1, 2**16)
    wanted = validate_spps(spps)
    validate_named("samplers", samplers)
    checks.progress(progress)
    if regions is None:
        regions = {"whole": np.s_[:], "upper": np.s_[: height // 2], "lower": np.s_[height // 2 :]}
    _check_regions(regions, width, height)
    mesh = devices.validate_mesh(mesh)
    makers: dict[str, Any] = {name: partial(_one, name, made) for name, made in samplers.items()}
    if keys is not None:
        keys = checks.integer("keys", keys, 1, 2**16)
        makers = {name: Maker(name, made, width, height, keys).all for name, made in samplers.items()}
    plan = [(name, spp, make(spp)) for name, make in makers.items() for spp in wanted]
    places = {(name, spp): place for place, (name, spp, _) in enumerate(plan)}
    for _, spp, made in plan:
        for sampler in made:
            sampler.check(width, height, spp)
    exact, bound = _reference(scene, reference, width, height)
    rows, saved = [], None
    if checkpoint is not None:
        of_samplers = [(name, spp, made if keys else made[0]) for name, spp, made in plan]
        of_rows = {"samplers": of_samplers, "regions": dict(regions), "reference": exact, "repeats": repeats}
        saved = checkpoints.begin(checkpoint, mesh, scene=scene, width=width, height=height, **of_rows)
        rows = [_from_json(**row) for row in json.loads(str(saved.state.get("rows", "[]")))]
    process, own = devices.of_process(mesh)
    finished = {(row.sampler, row.spp) for row in rows}
    rest = [planned for planned in plan if planned[:2] not in finished]
    with saved or nullcontext():
        while rest:
            # Processes of a mesh render images of similar cost at the same time, to avoid waiting.
            rest.sort(key=lambda planned: _expected_seconds(rows, *planned[:2]))
            at_once = [rest.pop(0) for _ in range(min(devices.processes(mesh), len(rest)))]
            measured = np.zeros(2 + len(regions) * (keys or 1))
            if process < len(at_once):
                _, spp, (sampler, *others) = at_once[process]
                measured[0], image = time_render(scene, sampler, width, height, spp, own)
                repeated = [time_render(scene, sampler, width, height, spp, own)[0] for _ in range(repeats)]
                measured[1] = statistics.median(repeated)
                of_keys = (time_render(scene, other, width, height, spp, own)[1] for other in others)
                errors = [_errors(each, exact, regions) for each in itertools.chain([image], of_keys)]
                measured[2 : 2 + np.size(errors)] = np.ravel(errors)
            told = devices.gather(measured.view(np.uint32), mesh).view(np.float64)
            for (name, spp, made), (first, seconds, *errors) in zip(at_once, told.tolist(), strict=False):
                by_key = np.reshape(errors, (-1, len(regions)))[: len(made)]
                by_key = by_key[:1] if (by_key == by_key[0]).all() else by_key
                values = {region: tuple(of.tolist()) for region, of in zip(regions, by_key.T, strict=True)}
                means = {region: geometric_mean(of) for region, of in values.items()}
                rows.append(ConvergenceRow(name, spp, means, seconds, first, values if keys else {}))
            if saved is not None and saved.due(last=not rest):
                saved.write(rows=json.dumps([asdict(row) for row in rows]))
            if progress is not None:
                progress(len(rows) / len(plan))
    return ConvergenceTable(tuple(sorted(rows, key=lambda row: places[row.sampler, row.spp])), bound)


def _reference(scene: Any, given: Any, width: int, height: int) -> tuple[NDArray[np.float64], float]:
    """Return the exact image and the largest bound on its errors; raise if they are invalid."""
    name = "reference"
    if given is None:
        name = "scene.reference(width, height)"
        if not callable(getattr(scene, "reference", None)):
            raise TypeError(
                f"scene must have a reference(width, height) unless reference is given, for example by "
                f"qmcjax.estimated_reference, got {checks.shown(scene)}"
            )
        given = scene.reference(width, height)
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise TypeError(
            f"{name} must be a pair of an image and a bound on its errors, got {_describe(given)}"
        )
    image = _arguments.array(f"{name}[0]", given[0], "an image").astype(np.float64)
    bound = _arguments.array(f"{name}[1]", given[1], "a bound on the image's errors").astype(np.float64)
    if image.shape not in ((height, width), (height, width, 3)):
        shapes = f"({height}, {width}) or ({height}, {width}, 3)"
        raise ValueError(f"{name}[0] must have shape {shapes}, got {image.shape}")
    _arguments.check_finite(f"{name}[0]", image)
    if bound.size == 0 or not (np.isfinite(bound) & (bound >= 0)).all():
        raise ValueError(
            f"{name}[1] must be bounds that are finite and at least 0, got {_describe(given[1])}"
        )
    return image, float(bound.max())


def _describe(value: Any) -> str:
    return f"{len(value)} values" if isinstance(value, tuple | list) else checks.shown(value)


def _check_regions(regions: Mapping[str, Any], width: int, height: int) -> None:
    """Raise a ValueError unless there are regions and each selects pixels, without making an image."""
    validate_named("regions", regions, "indices of numpy")
    pixels = np.broadcast_to(np.bool_(True), (height, width))
    for name, region in regions.items():
        try:
            empty = pixels[region].size == 0
        except IndexError as error:
            raise ValueError(f"regions[{name!r}] must select pixels of {width} x {height}: {error}") from None
        if empty:
            raise ValueError(f"regions[{name!r}] must select pixels of {width} x {height}, got {region!r}")


def _one(name: str, made: Any, spp: int) -> tuple[Sampler]:
    """Return a sampler, or the one that a function makes for this number of samples per pixel."""
    if not hasattr(made, "dims") and callable(made) and not isinstance(made, type):
        of = "of the samples per pixel (for one of x, y and sample, use samplers.function)"
        checks.function(f"samplers[{name!r}]", made, of)
        made = made(spp)
    return (as_sampler(f"samplers[{name!r}]", made),)


def _from_json(values: Mapping[str, list[float]] | None = None, **row: Any) -> ConvergenceRow:
    return ConvergenceRow(**row, values={region: tuple(of) for region, of in (values or {}).items()})


def _expected_seconds(rows: list[ConvergenceRow], sampler: str, spp: int) -> float:
    """Return the expected seconds of an image, from the last one of the same sampler; 0 if there is none."""
    last = next((row for row in reversed(rows) if row.sampler == sampler), None)
    return 0.0 if last is None else last.seconds * spp / last.spp


def time_render(
    scene: Scene, sampler: SamplerLike, width: int, height: int, spp: int, mesh: Mesh | None = None
) -> tuple[float, Array]:
    """Render, and return the seconds and the image."""
    start = time.perf_counter()
    image = render(scene, sampler, width, height, spp, mesh=mesh).block_until_ready()
    return time.perf_counter() - start, image


def _errors(image: Array, reference: NDArray, regions: Mapping[str, Any]) -> list[float]:
    if image.shape != reference.shape:
        raise ValueError(
            f"reference must have the shape of the scene's image {image.shape}, got {reference.shape}"
        )
    square = np.square(np.asarray(image, np.float64) - reference)
    return [math.sqrt(square[region].mean()) for region in regions.values()]
