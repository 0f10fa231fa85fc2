"""How time and memory of the measures grow with the number of points."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import _measure_cost, _process

MIB = 2**20


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure in a process of its own, and draw time and memory over n, with their slopes."""
    measured = _process.measured(_measure_cost, quality)
    progress(0.9)

    figure = Figure(figsize=(13, 9), layout="constrained")
    figure.suptitle("Cost of the measures of n random points (in brackets: slope of the larger half)")
    times, memory = figure.subplots(1, 2)
    slopes = {}
    for number, (name, rows) in enumerate(measured.items()):
        slopes[name] = {
            "seconds": _line(times, name, number, rows["n"], rows["seconds"], 0.0),
            "bytes": None,
        }
        if None not in rows["bytes"]:
            taken = [count / MIB for count in rows["bytes"]]
            slopes[name]["bytes"] = _line(memory, name, number, rows["n"], taken, 0.5)
    times.set(title="median time, warm", xlabel="points", ylabel="seconds")
    memory.set(title="peak memory over that before the call", xlabel="points", ylabel="MiB")
    for axes in (times, memory):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=2, fontsize=8)
        axes.grid(alpha=0.3)
    return figure, {
        "measured": {"slopes": slopes, **measured},
        "note": "Exponents of least-squares fits to the larger half of the n. Memory below half a MiB is not "
        "told apart from noise, not drawn and not in the fits. Drafts are small and say little.",
    }


def _line(
    axes: Axes, name: str, number: int, n: list[int], values: list[float], floor: float
) -> float | None:
    """Draw one measure, and return its slope, if there are two values above the floor."""
    x, y = np.array(n, float), np.array(values)
    fitted = np.flatnonzero(y > floor)
    fitted = fitted[fitted >= len(x) // 2]
    slope = None
    if len(fitted) >= 2:
        slope = float(np.polyfit(np.log(x[fitted]), np.log(y[fitted]), 1)[0])
    label = name if slope is None else f"{name} ({slope:.2f})"
    style = ("o-", "s--", "^:")[number // 8 % 3]
    axes.loglog(x, np.where(y > floor, y, np.nan), style, ms=3, color=f"C{number % 8}", label=label)
    return slope
