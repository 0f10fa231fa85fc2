"""The two planar test scenes: samplers compared, images, convergence (thesis Fig. 6.1 to 6.4)."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import plot
from figures._errors import residual, rms, slope
from figures.making import finished_cells
from figures.making.schema import UNDECIDED, Claims, Found
from figures.shared import judged
from figures.shared.rendered import pixel_sets, scene_images
from figures.shared.sheets.image_sheets import Crop, Panel, add_axes, beside, cut, image_grid, mark
from qmcjax import samplers, scenes, sequences
from qmcjax.orders import log_side

REGIONS = ("whole", "upper", "lower")

Sets = dict[str, NDArray[np.float64]]
"""Errors of random sets of pixels and of all counts, shape (sets, counts), by sampler."""

SIZE = {"draft": (128, 4), "paper": (512, 7)}
"""Side of an image for convergence, and the logarithm, to base 4, of its largest number of samples."""

KEYS = {"draft": 1, "paper": 4}
"""Jittered grids are random: their errors are averaged over so many."""

VISIBLE = 2.0
"""How much larger the error of a row of pixels is that is seen as a line."""

SHOWN = 64
"""Samples per pixel of the errors that are drawn."""

MATRICES = "optimised matrices: ours"
LARCHER = "Larcher-Pillichshammer"


def _net(make: Callable[[int], Any], side: int) -> Callable[[int], samplers.Sampler]:
    """Return spp -> the sampler of one net over a square screen."""
    return lambda spp: samplers.full_screen(make(2 * log_side(side, side) + spp.bit_length() - 1), side, side)


def _jittered(side: int, key: int) -> Callable[[int], samplers.Sampler]:
    return lambda spp: samplers.full_screen(sequences.jittered(side * round(spp**0.5), 2, key), side, side)


def deterministic(side: int) -> dict[str, Callable[[int], samplers.Sampler]]:
    """Return the samplers of Sect. 6.1 but for the jittered grid, for a square screen."""
    return {
        "rank-1 lattice": lambda spp: samplers.independent(sequences.rank1_lattice(spp), 0, "shift"),
        "Hammersley": _net(sequences.hammersley_net, side),
        "Larcher-Pillichshammer": _net(sequences.larcher_pillichshammer_net, side),
        "optimised matrices": _net(sequences.optimized_net, side),
        "permutation": _net(sequences.permutation_net, side),
    }


def pictures(
    scene: Any, title: str, crop: Crop, quality: str, progress
) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Show the exact image, and samplers at 64 samples per pixel in a magnified area; hand the images out."""
    side, spp = (512, 64) if quality == "paper" else (256, 64)
    makers = {"jittered grid": _jittered(side, key=0), **deterministic(side)}
    scene = scene_images.quickly_compiled(scene, quality)
    reference, bound = scene.reference(side, side)
    progress(0.5)
    images = {name: scene_images.rendered(scene, make(spp), side, spp) for name, make in makers.items()}
    errors = {name: rms(image - reference) for name, image in images.items()}
    captions = {name: f"{_fold(name)}\nRMS error {error:#.2g}" for name, error in errors.items()}
    lines = {name: _line(cut(image - reference, crop)) for name, image in images.items()}
    progress(0.9)
    images = {"exact reference": reference, **images}
    figure = _sheet(images, captions, f"{title}; {side} x {side} pixels, one key; {MATRICES}", crop)
    numbers = {
        "measured": {
            "rms_error": errors,
            "reference_error_bound": float(bound),
            "strongest line at the top of the magnified area": lines,
        },
        "claims": {
            "a line is visible at the top of the magnified area with the lattice, rotated as it is": (
                lines["rank-1 lattice"] == max(lines.values()) > VISIBLE
            ),
        },
        "note": f"{side} x {side} pixels, {spp} samples per pixel, box filter; the camera is ours where the "
        "thesis gives none. The lattice has 64 points, and a Cranley-Patterson rotation in each pixel. A "
        "line is a row of pixels whose RMS error is so many times the median of the eight rows around it, "
        f"visible from {VISIBLE:g} on. The thesis has the same caption below both of its lattice's images.",
    }
    return figure, numbers, images


def _line(error: np.ndarray) -> float:
    """Return how much one row in the upper half stands out from the rows around it."""
    rows = np.sqrt(np.mean(error**2, axis=1))
    around = [np.median([*rows[max(0, y - 4) : y], *rows[y + 1 : y + 5]]) for y in range(len(rows) // 2)]
    return float(np.max(rows[: len(around)] / around))


def _sheet(images: dict[str, np.ndarray], captions: dict[str, str], title: str, crop: Crop) -> Figure:
    """Show magnified areas beside the exact image, in the contrast that shows the errors of most of them."""
    areas = {name: cut(image, crop) for name, image in images.items()}
    exact, *others = areas.values()
    margin = 3 * float(np.median([rms(image - exact) for image in others]))
    limits = max(0.0, float(exact.min()) - margin), min(1.0, float(exact.max()) + margin)
    panels = [Panel(captions.get(name, "exact"), image, limits) for name, image in areas.items()]
    title += f"; magnified: black is {limits[0]:.2g}, white {limits[1]:.2g}"
    exact_image = next(iter(images.values()))
    return beside(title, mark("exact", exact_image, crop, "linear"), [panels[:4], panels[4:]])


def _fold(name: str) -> str:
    return name.replace("Larcher-", "Larcher-\n")


def convergence(
    scene: Any,
    title: str,
    crop: Crop,
    claims: Callable[[dict, Sets], Claims],
    base: str,
    quality: str,
    progress,
) -> tuple[Figure, dict]:
    """Plot error over samples per pixel, also relative to the sampler ``base``, and errors of an area.

    ``claims`` takes the errors of regions, the image and its halves, and of sets of pixels.
    """
    (side, largest), keys = SIZE[quality], KEYS[quality]
    averaged = f"RMS over {keys} keys" if keys > 1 else "one key"
    spps = [4**k for k in range(largest + 1)]
    scene = scene_images.quickly_compiled(scene, quality)
    found = _errors(scene, side, spps, keys, title, progress)
    sets = {name: of[len(REGIONS) :] for name, of in found.items()}
    errors = {name: {str(r): found[name][k].tolist() for k, r in enumerate(REGIONS)} for name in found}

    makers = {"jittered grid": _jittered(side, key=0), **deterministic(side)}
    exact = cut(scene.reference(side, side)[0], crop)
    areas = {
        name: cut(scene_images.rendered(scene, make(SHOWN), side, SHOWN), crop) - exact
        for name, make in makers.items()
    }
    title += f"; {side} x {side} pixels; jittered grids: {averaged}; {MATRICES}"
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    figure = _draw(title, spps, whole | {"random": _random(scene, side, spps)}, base, areas)
    numbers = {
        "measured": {
            "spp": spps,
            "rms_error": errors,
            "slope": _slopes(spps, errors),
            "fluctuation": {name: residual(np.log(of_region["whole"])) for name, of_region in errors.items()},
        },
        "claims": claims(errors, sets),
        "note": f"{side} x {side} pixels. The thesis plots the norm of the error image, the RMS error times "
        f"{side}. Jittered grids: {averaged}. 'claims' lists the thesis's sentences "
        "and whether they hold in these numbers. 'fluctuation' is the root mean square of the distances of "
        "the errors' logarithms from the line that fits them best.",
    }
    return figure, numbers


def of_sets(scene: Any, side: int, spps: list[int]) -> Sets:
    """Return the errors of random sets of pixels; of jittered grids, those of one key."""
    found = _errors(scene, side, spps, 1, f"sets of pixels, {side}")
    return {name: of[len(REGIONS) :] for name, of in found.items()}


def _errors(
    scene: Any,
    side: int,
    spps: list[int],
    keys: int,
    label: str,
    progress: Callable[[float], None] = lambda part: None,
) -> Sets:
    """Return RMS errors of all samplers: of the regions, and below these of the sets of pixels."""
    makers = {f"jittered grid {key}": _jittered(side, key) for key in range(keys)} | deterministic(side)
    exact, pixels = scene.reference(side, side)[0], pixel_sets.all_pixels(side)

    def errors_of(name: str) -> list[NDArray[np.float64]]:
        made = ((makers[name](spp), spp) for spp in spps)
        squares = [
            np.square(scene_images.rendered(scene, sampler, side, spp) - exact) for sampler, spp in made
        ]
        parts = (np.s_[:], np.s_[: side // 2], np.s_[side // 2 :], *zip(pixels.y, pixels.x, strict=True))
        return [np.sqrt([square[part].mean() for square in squares]) for part in parts]

    found = finished_cells.shared(label, {name: partial(errors_of, name) for name in makers}, progress)
    jittered = np.sqrt(np.mean([found[f"jittered grid {key}"] ** 2 for key in range(keys)], axis=0))
    return {"jittered grid": jittered} | {name: found[name] for name in deterministic(side)}


def _random(scene: Any, side: int, spps: list[int]) -> list[float]:
    """Return RMS errors of random samples: what one sample per pixel has, over the root of their number."""
    sampler = samplers.independent(sequences.uniform(2, 0), 0, "shift")
    image = scene_images.rendered(scene, sampler, side, 1)
    return (rms(image - scene.reference(side, side)[0]) / np.sqrt(spps)).tolist()


def _draw(
    title: str, spps: list[int], errors: dict[str, list[float]], base: str, areas: dict[str, NDArray]
) -> Figure:
    """Draw errors of an area above those of the image by samples per pixel, and these relative to one."""
    scale, height = 3 * rms(list(areas.values())), 800
    panels = [Panel(_fold(name).replace(" ", "\n"), area, (-scale, scale)) for name, area in areas.items()]
    title += f"\nimages: errors at {SHOWN} samples per pixel, {-scale:.2g} is black, {scale:.2g} white"
    figure = image_grid(title, panels, len(panels), below=height)
    relative = {name: np.divide(of, errors[base]).tolist() for name, of in errors.items() if name != "random"}
    for k, of in enumerate((errors, relative)):
        plot.convergence(
            spps,
            of,
            slopes=(),
            ylabel=f"RMS error relative to\n{base}" if k else "RMS error",
            ax=add_axes(figure, 215 + 1025 * k, 120, 410, height - 120 - 60),
        )
    return figure


def _slopes(spps: list[int], errors: dict[str, dict[str, list[float]]]) -> dict[str, dict[str, float]]:
    return {
        name: {region: slope(dict(zip(spps, of, strict=True))) for region, of in regions.items()}
        for name, regions in errors.items()
    }


CROP_6_1, CROP_6_2 = (0.4375, 0.0, 0.125), (0.375, 0.0, 0.234375)


def thesis_6_1(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of chapter 6."""
    title = "Checkerboard at 64 samples per pixel: the rotated lattice leaves a line\nthesis, Fig. 6.1"
    return pictures(scenes.checkerboard(), title, CROP_6_1, quality, progress)


ALIKE = 4 / 3
"""Errors whose ratio is below are similar."""


def _claims_6_2(errors: dict, sets: Sets) -> Claims:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    low_discrepancy = {name: found for name, found in whole.items() if name != "jittered grid"}
    nets = [found for name, found in low_discrepancy.items() if name != "rank-1 lattice"]
    count = len(whole["permutation"])
    wins = sum(min(whole, key=lambda name: whole[name][k]) == "Larcher-Pillichshammer" for k in range(count))
    fluctuations = {name: residual(np.log(found)) for name, found in whole.items()}
    return {
        "Larcher-Pillichshammer best for most sample counts": 2 * wins > count,
        "the quasi-Monte Carlo samplers perform similarly well": {
            "all of them": _similar(list(low_discrepancy.values())),
            "all but the lattice": _similar(nets),
        },
        "the lattice depends most on the sample count": (
            max(fluctuations, key=lambda name: fluctuations[name]) == "rank-1 lattice"
        ),
        "the lattice and all nets ahead of the jittered grid at the largest count": all(
            found[-1] < whole["jittered grid"][-1] for found in low_discrepancy.values()
        ),
    }


def _similar(errors: list[list[float]]) -> bool:
    return all(max(found) < ALIKE * min(found) for found in zip(*errors, strict=True))


def thesis_6_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title = "Checkerboard: Larcher-Pillichshammer is best at most sample counts\nthesis, Fig. 6.2"
    return convergence(scenes.checkerboard(), title, CROP_6_2, _claims_6_2, LARCHER, quality, progress)


CROP_6_3 = (0.703125, 0.703125, 0.234375)


def thesis_6_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict, dict[str, np.ndarray]]:
    """Render the scene with the samplers of chapter 6."""
    title = (
        "Zone plate at 64 samples per pixel: noise of the jittered grid hides fine rings\nthesis, Fig. 6.3"
    )
    return pictures(scenes.zone_plate(), title, CROP_6_3, quality, progress)


SIDES = {"draft": (), "paper": (128, 256, 1024)}
"""Of further images on which the order of the samplers is judged, beside the one that is shown."""
LARGEST = 6
"""Logarithm, to base 4, of the largest number of samples of these."""

MANY = 4
"""The same of the samples beyond which another net is said to be the best."""


def thesis_6_4(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the error of the samplers of chapter 6 against the exact pixel integrals."""
    title = "Zone plate: in places nets and lattices are worse than the jittered grid\nthesis, Fig. 6.4"
    claims = partial(_claims_6_4, quality)
    return convergence(scenes.zone_plate(), title, CROP_6_3, claims, "jittered grid", quality, progress)


def _claims_6_4(quality: str, errors: dict, sets: Sets) -> Claims:
    whole = {name: of_region["whole"] for name, of_region in errors.items()}
    shown = SIZE[quality][0]
    by_size = {f"{shown} x {shown} pixels": sets} | {
        f"{side} x {side} pixels": of_sets(scenes.zone_plate(), side, [4**k for k in range(LARGEST + 1)])
        for side in SIDES[quality]
    }

    def best(name: str, few: bool) -> dict[str, Found]:
        """Return by size and count whether a sampler has less error than all others."""
        return {
            f"{size}, {4**k} spp": judged.all_smaller(
                {each: values[:, k] for each, values in of.items()}, [name], of.keys() - {name}
            )
            for size, of in by_size.items()
            for k in range(of[name].shape[1])
            if few == (k <= MANY)
        }

    return {
        "Larcher-Pillichshammer best up to 256 samples per pixel": best(LARCHER, few=True),
        "permutation net best beyond 256 samples per pixel": best("permutation", few=False) or UNDECIDED,
        "in parts worse than the jittered grid": {
            name: any(a > b for a, b in zip(whole[name], whole["jittered grid"], strict=True))
            for name in ("Hammersley", "rank-1 lattice", "optimised matrices")
        },
    }
