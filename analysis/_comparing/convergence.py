"""Error and run time of samplers against the number of samples."""

from __future__ import annotations

import json
import math
import os
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jax import Array
from jax.sharding import Mesh
from numpy.typing import NDArray

from analysis import _arguments
from qmcjax.core import checkpoints, checks, devices, tables
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.rendering import render
from qmcjax.samplers import SamplerLike, as_sampler
from qmcjax.scenes import Scene, as_scene


@dataclass(frozen=True)
class ConvergenceRow:
    """One image: its error in each region, and its run time."""

    sampler: str
    spp: int
    errors: dict[str, float]
    """Root mean square error of each region."""
    seconds: float
    """Median over the repeated renderings."""
    first_seconds: float
    """The first rendering, including compilation if needed."""


@dataclass(frozen=True)
class ConvergenceTable:
    """The images of all samplers, by sampler and then by samples per pixel; as text, a table."""

    rows: tuple[ConvergenceRow, ...]
    bound: float
    """Bound on the error of the reference: do not trust errors near it."""

    def __str__(self) -> str:
        lines = [["sampler", "spp", *self.rows[0].errors, "seconds"]] if self.rows else []
        for row in self.rows:
            numbers = (f"{number:.3g}" for number in (*row.errors.values(), row.seconds))
            lines.append([row.sampler, str(row.spp), *numbers])
        return f"{tables.aligned(lines)}\nerrors of the reference: at most {self.bound:.3g}"

    def errors(self, sampler: str, region: str = "whole") -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the numbers of samples per pixel, and the errors, of one sampler in one region."""
        if not isinstance(sampler, str) or not isinstance(region, str):
            wrong = ("region", region) if isinstance(sampler, str) else ("sampler", sampler)
            raise TypeError(f"{wrong[0]} must be a name, got {checks.shown(wrong[1])}")
        rows = [row for row in self.rows if row.sampler == sampler]
        if not rows:
            known = list(dict.fromkeys(row.sampler for row in self.rows))
            raise ValueError(f"sampler must be one of {known}, got {sampler!r}")
        if region not in rows[0].errors:
            raise ValueError(f"region must be one of {list(rows[0].errors)}, got {region!r}")
        return np.array([row.spp for row in rows]), np.array([row.errors[region] for row in rows])

    def slope(self, sampler: str, region: str = "whole") -> float:
        """Return the exponent a of the least-squares fit of error = c * spp^a, in logarithms."""
        spps, errors = self.errors(sampler, region)
        if len(spps) < 2 or not np.all(errors > 0):
            raise ValueError(
                f"the slope of sampler {sampler!r} needs two or more errors, none zero, got {errors}"
            )
        from scipy.stats import linregress

        line: Any = linregress(np.log(spps), np.log(errors))
        return float(line.slope)

    def slope_interval(self, sampler: str, region: str = "whole", level: float = 0.95) -> tuple[float, float]:
        """Return a confidence interval of the slope, by Student's distribution for the slope of a line.

        Parameters
        ----------
        level : float
            In (0, 1): the probability that the interval contains the slope, if the logarithms of errors are
            independent and normal around a line. It does not account for curvature.

        Returns
        -------
        lower, upper : float

        Raises
        ------
        ValueError
            If there are fewer than three errors, or one of them is zero.
        """
        from scipy.special import stdtrit
        from scipy.stats import linregress

        spps, errors = self.errors(sampler, region)
        level = _arguments.real("level", level, "in (0, 1)", lambda x: 0 < x < 1)
        if len(spps) < 3 or not np.all(errors > 0):
            raise ValueError(
                f"the interval of sampler {sampler!r} needs three or more errors, none zero, got {errors}"
            )
        line: Any = linregress(np.log(spps), np.log(errors))
        width = stdtrit(len(spps) - 2, (1 + level) / 2) * line.stderr
        return float(line.slope - width), float(line.slope + width)

    def efficiency(self, sampler: str, region: str = "whole") -> NDArray[np.float64]:
        """Return 1 / (seconds * mean squared error) for each number of samples.

        At twice the efficiency, the same error takes half the time, if errors decrease as for random samples.
        It is infinite for an error of zero.
        """
        _, errors = self.errors(sampler, region)
        seconds = np.array([row.seconds for row in self.rows if row.sampler == sampler])
        with np.errstate(divide="ignore"):
            return 1 / (seconds * errors**2)


def convergence(
    scene: Scene,
    samplers: Mapping[str, SamplerLike | Callable[[int], SamplerLike]],
    spps: Iterable[int],
    *,
    width: int = 128,
    height: int = 128,
    regions: Mapping[str, Any] | None = None,
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
        are made for one number of samples.
    spps : iterable of int, different numbers of samples per pixel, at least 1
    width, height : int, in [1, 65536]
    regions : mapping of names to numpy indices, optional
        Selections from an image of shape (height, width), such as ``numpy.s_[:64, 32:]`` or a mask. By
        default the "whole" image, and its "upper" and "lower" half: the first ``height // 2`` rows and the
        rest.
    repeats : int
        Number of renderings for the median time, after the first one.
    reference : (image, bound), optional
        Replaces the reference of the scene: an image of shape (height, width) or (height, width, 3), and one
        bound on the errors of its values, or an array of bounds, as from :func:`qmcjax.estimated_reference`.
    progress : callable, optional, called with the finished fraction in (0, 1] after each image
    checkpoint : path or Checkpoint, optional
        A file for the rows of finished images, written every half minute. Calling the function again with the
        same arguments resumes from it, with the times measured before. The file is not deleted. With foreign
        code, pass a :class:`qmcjax.Checkpoint` with a label.
    mesh : jax.sharding.Mesh, optional
        Devices, as in :func:`qmcjax.render`. All its processes make the same call and share the images; the
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
    plan = [(name, spp, _sampler(name, made, spp)) for name, made in samplers.items() for spp in wanted]
    places = {(name, spp): place for place, (name, spp, _) in enumerate(plan)}
    for _, spp, sampler in plan:
        sampler.check(width, height, spp)
    exact, bound = _reference(scene, reference, width, height)
    rows, saved = [], None
    if checkpoint is not None:
        of_rows = {"samplers": plan, "regions": dict(regions), "reference": exact, "repeats": repeats}
        saved = checkpoints.begin(checkpoint, mesh, scene=scene, width=width, height=height, **of_rows)
        rows = [ConvergenceRow(**row) for row in json.loads(str(saved.state.get("rows", "[]")))]
    process, own = devices.of_process(mesh)
    finished = {(row.sampler, row.spp) for row in rows}
    rest = [planned for planned in plan if planned[:2] not in finished]
    with saved or nullcontext():
        while rest:
            # Processes of a mesh render images of similar cost at the same time, to avoid waiting.
            rest.sort(key=lambda planned: _expected_seconds(rows, *planned[:2]))
            at_once = [rest.pop(0) for _ in range(min(devices.processes(mesh), len(rest)))]
            measured = np.zeros(2 + len(regions))
            if process < len(at_once):
                _, spp, sampler = at_once[process]
                measured[0], image = time_render(scene, sampler, width, height, spp, own)
                repeated = [time_render(scene, sampler, width, height, spp, own)[0] for _ in range(repeats)]
                measured[1:] = statistics.median(repeated), *_errors(image, exact, regions).values()
            told = devices.gather(measured.view(np.uint32), mesh).view(np.float64).tolist()
            for (name, spp, _), (first, seconds, *errors) in zip(at_once, told, strict=False):
                rows.append(
                    ConvergenceRow(name, spp, dict(zip(regions, errors, strict=True)), seconds, first)
                )
            if saved is not None and saved.due(last=not rest):
                saved.write(rows=json.dumps([asdict(row) for row in rows]))
            if progress is not None:
                progress(len(rows) / len(plan))
    return ConvergenceTable(tuple(sorted(rows, key=lambda row: places[row.sampler, row.spp])), bound)


def validate_spps(spps: Any) -> list[int]:
    """Return numbers of samples per pixel; raise unless they are different and at least one."""
    try:
        given = list(spps)
    except TypeError:
        raise TypeError(f"spps must be numbers of samples per pixel, got {checks.shown(spps)}") from None
    given = [checks.integer("spps", spp, 1, 2**32 - 1) for spp in given]
    if not given or len(set(given)) < len(given):
        raise ValueError(f"spps must be one or more different numbers, got {given}")
    return given


def validate_named(kind: str, given: Any, what: str | None = None) -> None:
    """Raise unless names are mapped to something, such as samplers."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{kind} must map names to {what or kind}, got {checks.shown(given)}")
    if not given:
        raise ValueError(f"{kind} must be one or more, got {given!r}")


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


def _sampler(name: str, made: Any, spp: int) -> Any:
    """Return a sampler, or the one that a function makes for this number of samples per pixel."""
    if not hasattr(made, "dims") and callable(made) and not isinstance(made, type):
        of = "of the samples per pixel (for one of x, y and sample, use samplers.function)"
        checks.function(f"samplers[{name!r}]", made, of)
        made = made(spp)
    return as_sampler(f"samplers[{name!r}]", made)


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


def _errors(image: Array, reference: NDArray, regions: Mapping[str, Any]) -> dict[str, float]:
    if image.shape != reference.shape:
        raise ValueError(
            f"reference must have the shape of the scene's image {image.shape}, got {reference.shape}"
        )
    square = np.square(np.asarray(image, np.float64) - reference)
    return {name: math.sqrt(square[region].mean()) for name, region in regions.items()}
