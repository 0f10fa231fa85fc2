"""Z paper Fig. 11: convergence of four samplers on the scenes of Fig. 1 and 10."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures import plot
from figures._errors import rms
from figures.shared import diffusion, padded_samplers, scene_images
from figures.z.z_1 import KEY, ways
from qmcjax import samplers, scenes

SIDE = {"draft": 32, "paper": 64}
LARGEST = {"draft": 3, "paper": 5}
"""Logarithm, to base 4, of the largest number of samples."""
REFERENCE_SPP = {"draft": 1024, "paper": 65536}
BOUNCES = {"draft": 2, "paper": 6}

SAME = 1.15
"""Up to this factor errors are almost identical."""

NOTE = (
    "{side} x {side} pixels; scenes of the package for those of the paper: sports for motion blur, defocus "
    "for depth of field, the interior for path tracing, with {bounces} bounces, and the caustic for "
    "bidirectional path tracing. Up to 16 samples, 2 % of the pixels have half of the square error of "
    "defocus or more, mostly over 0.9 at one sample: this curve, and perhaps that of sports, depend on luck. "
    "Samplers are those of Fig. 1; ranked keys, after Heitz et al., are our own, with an order of the "
    "samples for each pair of dimensions: in about the same order in all pairs, the error would level off, "
    "as that of Z0 does in Fig. 12. Theirs has 256 dimensions of one Owen-scrambled Sobol' sequence. "
    "That Sobol' "
    "overtakes is said of 'considerably high' rates, which drafts do not reach. 'Almost identical' is "
    f"within a factor of {SAME}. "
    "{origins}" + diffusion.EXPLAINED
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure RMS errors over the number of samples."""
    side = SIDE[quality]
    counts = [4**k for k in range(LARGEST[quality] + 1)]
    compared = {
        "sports": scenes.sports(),
        "defocus": scenes.defocus(),
        "interior": scenes.interior(BOUNCES[quality]),
        "caustic": scenes.caustic(),
    }
    figure = Figure(figsize=(11, 8.5), layout="constrained")
    figure.suptitle("Convergence on rendered scenes (Z paper, Fig. 11)")
    measured: dict[str, dict[str, dict[str, dict[str, float]]]] = {}
    origins = ""
    for done, (axes, (title, scene)) in enumerate(
        zip(figure.subplots(2, 2).flat, compared.items(), strict=True), start=1
    ):
        area = diffusion.beside_window(side) if title == "interior" else diffusion.WHOLE
        exact = diffusion.reference(scene, side, REFERENCE_SPP[quality])
        origins += f"The reference of {title} is {exact.origin}. "
        found = measured.setdefault(title, {})
        made = {spp: _ways(len(scene.needs), side, spp) for spp in counts}
        for (spp, name), image in scene_images.compared(scene, side, made).items():
            found.setdefault(name, {})[f"{spp} spp"] = diffusion.measures(image, exact, area)
        errors = {
            name: [of_count[f"{spp} spp"]["RMS error"] for spp in counts] for name, of_count in found.items()
        }
        floor = rms(exact.error[area])
        if floor < min(map(min, errors.values())) / 10:
            floor = None  # It does not matter, and would take the most of the axis.
        plot.convergence(counts, errors, floor=floor, title=f"{title}, {side} x {side} pixels", ax=axes)
        progress(done / len(compared))
    note = NOTE.format(side=side, bounces=BOUNCES[quality], origins=origins)
    return figure, {"measured": measured, "claims": _claims(measured, counts), "note": note}


def _ways(dims: int, side: int, spp: int) -> dict[str, samplers.Sampler]:
    """Return the samplers of Fig. 1; all pairs of dimensions have the samples in orders of their own."""
    heitz = padded_samplers.ranked_in_orders(
        padded_samplers.pairs(dims), KEY, KEY + 1, (spp - 1).bit_length()
    )
    return ways(dims, side, spp) | {"ranked keys": heitz}


def _claims(measured: dict, counts: list[int]) -> dict[str, dict[str, bool]]:
    last = f"{counts[-1]} spp"

    def error(title: str, name: str, spp: str) -> float:
        return measured[title][name][spp]["RMS error"]

    def identical(title: str, spp: str) -> bool:
        return 1 / SAME < error(title, "Z", spp) / error(title, "(0,2)", spp) < SAME

    return {
        "Z almost identical to (0,2), at all counts": {
            title: all(identical(title, f"{spp} spp") for spp in counts) for title in measured
        },
        "Z almost identical to (0,2), at the largest count": {
            title: identical(title, last) for title in measured
        },
        "Sobol' eventually overtakes (0,2) and Z: it has by the largest count": {
            title: error(title, "Sobol'", last)
            < min(error(title, "(0,2)", last), error(title, "Z", last)) / SAME
            for title in measured
        },
        "ranked keys eventually overtake (0,2) and Z: they have by the largest count": {
            title: error(title, "ranked keys", last)
            < min(error(title, "(0,2)", last), error(title, "Z", last)) / SAME
            for title in measured
        },
        "ranked keys tend to lead, surpassing Sobol': over the counts, it has the least product of errors": {
            title: _product(measured[title], "ranked keys")
            == min(_product(measured[title], n) for n in measured[title])
            for title in measured
        },
    }


def _product(found: dict[str, dict[str, dict[str, float]]], name: str) -> float:
    product = 1.0
    for values in found[name].values():
        product *= values["RMS error"]
    return product
