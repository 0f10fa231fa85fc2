"""How long the exact measures take, on points of all kinds, beside peers; and what gradients cost."""

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures.making import own_process
from figures.shared import measure_speed

COLORS = dict(zip(measure_speed.FAMILIES, ("C0", "0.6", "C4", "C2"), strict=True))


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a process of its own, and draw bars with what was asked for."""
    measured = own_process.measured(measure_speed, quality)
    progress(0.9)

    figure = Figure(figsize=(16, 6), layout="constrained")
    figure.suptitle("Measures of points: medians of calls after the first (black: what was asked for)")
    absolute, relative, gradients = figure.subplots(1, 3)
    _families(absolute, measured["seconds"], "seconds")
    absolute.set(title="time (lower is better)", xlabel="seconds")
    _families(relative, measured["against peers"], "ratio")
    relative.set(title="times as fast as the peer (higher is better)", xlabel="ratio")
    for row, entry in enumerate(measured["gradients"].values()):
        gradients.barh(row, entry["ratio"], color="C0")
    gradients.axvline(measure_speed.ASKED_RATIO, color="black")
    gradients.set_yticks(range(len(measured["gradients"])), list(measured["gradients"]))
    gradients.set(title="with gradient / value (lower is better)", xlabel="ratio")
    for axes in figure.axes:
        axes.invert_yaxis()
        axes.grid(axis="x", alpha=0.3)
    handles, labels = absolute.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    return figure, {
        "measured": measured,
        "note": "cKDTree is built with boxsize=1 and asked with two workers. scipy's L2-star discrepancy "
        "is the value alone; ours includes the gradient. Titles name the sizes of the paper quality. Drafts "
        "are small and say little.",
    }


def _families(axes: Axes, cases: dict[str, dict], key: str) -> None:
    """Draw the bars of all families, and a line at what was asked for."""
    height = 0.8 / len(COLORS)
    for row, entry in enumerate(cases.values()):
        for k, (family, color) in enumerate(COLORS.items()):
            label = family if row == 0 else None
            axes.barh(row + (k - 1.5) * height, entry[key][family], height, color=color, label=label)
        axes.plot([entry["asked"]] * 2, [row - 0.4, row + 0.4], color="black")
    titles = [f"{name.replace(' / ', chr(10) + '/ ')}\n(n = {entry['n']})" for name, entry in cases.items()]
    axes.set_yticks(range(len(cases)), titles, fontsize=8)
