"""Minimum distances and power spectra of two-dimensional nets (Fig. 5.21, 5.22, Table 5.1)."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import analysis
from figures import plot
from figures.shared.sheets import point_plots
from figures.shared.sheets.image_sheets import Panel, image_grid
from figures.shared.sheets.panels import curve, legend_below, name_axes, new_figure, text_table
from qmcjax import sequences

PRINTED = {
    "Hammersley": [2] * 15,
    "Larcher-Pillichshammer": [2, 5, 8, 18, 32, 72, 128, 265, 512, 1060, 2048, 4153, 8192, 16612, 32768],
    "optimised matrices": [2, 8, 13, 29, 52, 100, 208, 400, 832, 1600, 3328, 6385, 13312, 25313, 53248],
    "permutation": [2, 8, 13, 32, 53, 128, 241, 512, 964, 2048, 3856, 8192, 15424, 32768, 61696],
}
"""The radicands."""

DECIMALS = {
    "Hammersley": "0.35355339 0.17677670 0.088388835 0.04419417 0.02209709 0.0104854 0.00552427 0.00276214 "
    "0.00138107 0.00069053 0.00034527 0.00017263 0.00008632 0.00004316 0.00002158",
    "Larcher-Pillichshammer": "0.35355339 0.27950850 0.17677670 0.13258252 0.088388835 0.06629126 0.04419417 "
    "0.03179457 0.02209709 0.01589729 0.0104854 0.00786667 0.00552427 0.00393334 0.00276214",
    "optimised matrices": "0.35355339 0.35355339 0.22534695 0.16828640 0.11267348 0.07812500 0.05633674 "
    "0.03906250 0.02816837 0.01953125 0.01408418 0.00975417 0.00704209 0.00485536 0.00352105",
    "permutation": "0.35355339 0.35355339 0.22534695 0.17677670 0.11375172 0.08838835 0.0664131 0.04419417 "
    "0.03032065 0.02209709 0.01516033 0.0104854 0.00758016 0.00552427 0.00379008",
}
"""What is printed beside them, for their roots over 2**m."""

NETS_5_21 = {
    "Hammersley": sequences.hammersley_net,
    "Larcher-Pillichshammer": sequences.larcher_pillichshammer_net,
    "optimised matrices": sequences.optimized_net,
    "permutation": sequences.permutation_net,
}
SIZES = range(2, 17)
LABELS = {"optimised matrices": "our optimised matrices"}
"""In pictures, of names that would be taken for the thesis's own."""
STYLES = {"permutation, not sheared": plot.Style("C1", "x", ":")}
NOTE = (
    "Squared distances on the integer grid. Permutation nets of even m: with the sheared tiling, whose "
    "rows are shifted by 2**(m - 2); 'not sheared' is on the plain torus. m = 2 is the Hammersley net: "
    "the construction starts at m = 4. Optimised matrices are from our search; for odd m from 9 on they "
    "have larger distances than the printed ones. The right panel, ours, shows distances relative to "
    "sqrt(2 / (sqrt(3) n)), the densest packing of n points."
)


def _squared(name: str, m: int, sheared: bool) -> int:
    points = point_plots.words(NETS_5_21[name](m), m)
    return analysis.squared_min_distance(points, side=2**m, shear=2 ** (m - 2) if sheared else 0)


def thesis_5_21(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the nets and plot the distances over m, with the table below."""
    measured: dict[str, list[int]] = {name: [] for name in (*NETS_5_21, "permutation, not sheared")}
    for m in SIZES:
        for name in NETS_5_21:
            measured[name].append(_squared(name, m, sheared=name == "permutation" and m % 2 == 0 and m > 2))
        measured["permutation, not sheared"].append(_squared("permutation", m, sheared=False))
        progress((m - 1) / len(SIZES))

    relative = {name: _relative(values) for name, values in measured.items()}
    misprints = _misprints()
    numbers = {
        "measured": {
            **_by_size(measured),
            "decimals that are not those of the printed roots": misprints,
            "distance over that of the densest packing": _by_size(relative),
        },
        "printed": {"squared distances": _by_size(PRINTED), "decimals": DECIMALS},
        "claims": _claims(measured, misprints),
        "note": NOTE,
    }
    return _draw(measured, relative, misprints), numbers


def _by_size(found: Mapping[str, Sequence[float]]) -> dict[str, dict[str, float]]:
    return {name: dict(zip(map(str, SIZES), values, strict=True)) for name, values in found.items()}


def _relative(squared: list[int]) -> list[float]:
    """Return distances over sqrt(2 / (sqrt(3) n)), which n points reach as a hexagonal lattice only."""
    n = 2.0 ** np.array(SIZES)
    return (np.sqrt(squared) / n / np.sqrt(2 / (np.sqrt(3) * n))).tolist()


def _misprints() -> dict[str, str]:
    """Return the decimals that are more than one in their last place off."""
    found = {}
    for name, text in DECIMALS.items():
        for m, squared, decimal in zip(SIZES, PRINTED[name], text.split(), strict=True):
            unit = 10.0 ** -len(decimal.partition(".")[2])
            if abs(float(decimal) - squared**0.5 / 2**m) > unit:
                found[f"{name}, m = {m}"] = decimal
    return found


def _claims(measured: dict[str, list[int]], misprints: dict[str, str]) -> dict[str, Any]:
    best = measured["permutation"]
    even = [m for m in SIZES if m % 2 == 0 and m >= 8]
    return {
        "the squared distances are those of Table 5.1": {
            name: measured[name] == PRINTED[name] for name in PRINTED
        },
        "the decimals of Table 5.1 are those of its roots": {
            name: not any(where.startswith(name) for where in misprints) for name in DECIMALS
        },
        "permutation nets have the largest distance": {
            name: all(a >= b for a, b in zip(best, measured[name], strict=True))
            for name in NETS_5_21
            if name != "permutation"
        },
        "for even m from 8 on it is sqrt(241 2^(m-8)) / 2^m": {
            f"m = {m}": best[m - SIZES[0]] == 241 * 2 ** (m - 8) for m in even
        },
    }


def _draw(
    measured: dict[str, list[int]], relative: dict[str, list[float]], misprints: dict[str, str]
) -> Figure:
    figure = new_figure(
        "Of all nets compared, permutation nets have the largest minimum distance\n"
        "thesis, Fig. 5.21 and Table 5.1; (0,m,2)-nets in base 2",
        6.3,
    )
    upper, lower = figure.subfigures(2, 1, height_ratios=[1, 1.1], squeeze=False)[:, 0]
    absolute, packed = upper.subplots(1, 2)
    for name, values in measured.items():
        drawn = STYLES.get(name) or plot.style(name)
        for axes, of in ((absolute, np.sqrt(values) / 2.0 ** np.array(SIZES)), (packed, relative[name])):
            curve(axes, dict(zip(SIZES, of, strict=True)), drawn, lw=1.2, label=LABELS.get(name, name))
    x = "m (the net has $2^m$ points)"
    name_axes(absolute, x, "toroidal minimum distance", log="y", ticks=SIZES[::2])
    name_axes(packed, x, "distance / densest packing's", ticks=SIZES[::2])
    packed.set_ylim(0, 1.12)
    packed.axhline(1, color="0.6", lw=0.8)
    packed.annotate("hexagonal lattice", (SIZES[-1], 1.01), va="bottom", ha="right", color="0.4")
    legend_below(upper, absolute, 3)
    heads = ["m", "Hammersley", "Larcher-P.", "ours", "thesis", "sheared", "not sheared"]
    names = ["Hammersley", "Larcher-Pillichshammer", "optimised matrices", "", *list(measured)[-2:]]
    rows = []
    for k, m in enumerate(SIZES):
        row = [str(m)]
        for name in names:
            value = measured[name][k] if name else PRINTED["optimised matrices"][k]
            row.append(f"{value}{'*' if f'{name}, m = {m}' in misprints else ''}")
        rows.append(row)
    table = lower.subplots()
    groups = [("optimised matrices", 3, 4), ("permutation", 5, 6)]
    text_table(table, heads, rows, groups, [0.5, *[1.0] * 6])
    table.set_title(
        "squared distances times $2^{2m}$ (*: the decimals printed beside it in the thesis are wrong)"
    )
    return figure


NETS_5_22 = {
    "Hammersley": (sequences.hammersley_net, 10),
    "Larcher-Pillichshammer": (sequences.larcher_pillichshammer_net, 10),
    "optimised matrices": (sequences.optimized_net, 10),
    "permutation, m = 10": (sequences.permutation_net, 10),
    "permutation, m = 11": (sequences.permutation_net, 11),
}
HIGHEST, HIGHEST_SHOWN = 128, 64
LARGEST_SHOWN = 32.0
SHARE = "share of power in the strongest 1 % of frequencies"


def thesis_5_22(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the spectra, and measure how much of their power is in how few frequencies."""
    measured: dict[str, dict[str, float]] = {}
    panels = []
    for k, (name, (net, m)) in enumerate(NETS_5_22.items()):
        spectrum = np.array(analysis.point_spectrum(point_plots.block(net(m), 2**m), 2 * HIGHEST + 1))
        spectrum[0, 0] = 0.0
        measured[name] = _statistics(spectrum, 2**m)
        # Frequencies upward, as the thesis draws points.
        middle = slice(HIGHEST - HIGHEST_SHOWN, HIGHEST + HIGHEST_SHOWN + 1)
        shown = np.fft.fftshift(spectrum)[::-1][middle, middle]
        panels.append(Panel(LABELS.get(name, name), shown, (0.0, LARGEST_SHOWN)))
        progress((k + 1) / len(NETS_5_22))
    title = (
        "Peaks in the spectra of permutation nets are almost as high as a lattice's\n"
        f"thesis, Fig. 5.22; power P at frequencies up to {HIGHEST_SHOWN} along both axes, 0 in the middle: "
        f"black is 0, white from {LARGEST_SHOWN:g} on; P of white noise is 1, of a lattice's peaks n"
    )
    figure = image_grid(title, panels, 3, below=90)
    _draw_peaks(figure, measured)
    permutations = [name for name in NETS_5_22 if name.startswith("permutation")]
    numbers = {
        "measured": measured,
        "claims": {
            "permutation nets have a pronounced structure: peaks above half of a lattice's": {
                name: measured[name]["highest power / n"] > 0.5 for name in permutations
            },
            "the spectra of matrix-generated nets are less concentrated than those of permutation nets": {
                name: all(of[SHARE] < measured[net][SHARE] for net in permutations)
                for name, of in measured.items()
                if name not in permutations
            },
        },
        "note": "The mean, k = 0, is left out. The thesis shows 1024 points each, 2048 for m = 11; it names "
        "neither the range of frequencies nor the scale of its pictures.",
    }
    return figure, numbers


def _draw_peaks(figure: Figure, measured: Mapping[str, Mapping[str, float]]) -> None:
    """Draw how high the peaks of all spectra are, where a sixth image would be."""
    right, lower = (figure.axes[k].get_position() for k in (2, 3))
    axes = figure.add_axes((right.x0 + 0.02, lower.y0, right.width - 0.04, lower.height))
    for k, (name, of) in enumerate(measured.items()):
        axes.barh(k, of["highest power / n"], color=plot.style(name.partition(",")[0]).color, height=0.4)
        axes.text(0, k - 0.25, LABELS.get(name, name), va="bottom")
    axes.axvline(1, color="0.6", lw=0.8)
    axes.invert_yaxis()
    axes.set(yticks=[], xlabel="highest P / n (lattice: 1)")


def _statistics(spectrum: np.ndarray, n: int) -> dict[str, float]:
    """Return the mean, the highest peak relative to a lattice's, and the share of the strongest 1 %."""
    ordered = np.sort(spectrum.ravel())[::-1]
    return {
        "mean power": float(ordered.sum() / (ordered.size - 1)),
        "highest power / n": float(ordered[0] / n),
        SHARE: float(ordered[: ordered.size // 100].sum() / ordered.sum()),
    }
