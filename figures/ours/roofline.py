"""Operations and bytes of a sample, and how many samples a second an H100 could make of them at most."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plot
from figures.shared import text_tables
from figures.shared.h100 import H100, programs
from figures.shared.operations import Operations, operations

SIZES = {"draft": (2**14, 64, 16), "paper": (2**20, 512, 64)}
"""Points, side of images, samples per pixel: counts of a sample hardly depend on them."""

KINDS = ("integer", "float32", "float64", "special")

TERA = 1e12

POINTS, IMAGES = plot.Style("#0072B2", "o"), plot.Style("#D55E00", "s")

BUSY = {
    "memory": "memory",
    "integer": "integers",
    "float32": "float32",
    "float64": "float64",
    "special": "special functions",
    "issue": "issue",
}

NOTE = (
    "Operations are counted in the text of the program that XLA compiles for this processor, on one "
    "number each; their sum is that of XLA's own analysis. Bytes are what its fused loops read and write, "
    "as if no cache kept anything from one loop to the next: a GPU's compiler may fuse other parts. The "
    "bound is the time for which the busiest part of an H100 would be busy, all others at no cost (NVIDIA "
    "H100 datasheet and architecture paper; results a clock of the CUDA C++ Best Practices Guide, compute "
    "capability 9.0). It is optimistic: a division or a sine takes more than the one instruction it is "
    "counted for, and rates are those of full occupancy. It is pessimistic in one way: up to three "
    "bitwise operations, or a product and a sum, can be one instruction. The ceiling of float32 in the "
    "plot counts instructions; the 67 TFLOP/s of the datasheet count two operations for each. No GPU was "
    "measured: python -m figures gpu does that where there is one. Drafts have a few of the programs."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Compile all programs, count, and draw the roofline over a table."""
    listed = list(programs(*SIZES[quality]).items())
    if quality == "draft":
        listed = listed[1::3]
    rows, exact = {}, []
    for done, (name, make_program) in enumerate(listed, start=1):
        program = make_program()
        rows[name] = _row(operations(program.compiled()), program.samples)
        if program.exact:
            exact.append(name)
        progress(done / len(listed))
    return _draw(rows, exact), {
        "measured": rows,
        "note": NOTE,
        "table": [{"program": name, **row} for name, row in rows.items()],
    }


def _row(counts: Operations, samples: int) -> dict:
    busy = H100.seconds(counts)
    most = max(busy, key=lambda part: busy[part])
    kinds = {kind: getattr(counts, kind) / samples for kind in KINDS}
    return kinds | {
        "bytes": counts.bytes / samples,
        "operations a byte": counts.total / counts.bytes,
        "samples a second": samples / busy[most],
        "bound by": BUSY[most],
    }


def _draw(rows: dict[str, dict], exact: list[str]) -> Figure:
    figure = Figure(figsize=(10, 4.8 + 0.24 * len(rows)), layout="constrained")
    figure.suptitle(f"What an {H100.name} could make of our programs, at most")
    layout = figure.subplot_mosaic("a;b", height_ratios=[4.2, 0.5 + 0.24 * len(rows)])
    _roofline(layout["a"], rows, exact)
    text_tables.draw(
        layout["b"],
        ["", "program", *KINDS, "bytes", "$10^9$ samples / s", "bound by"],
        [
            [
                str(number),
                name,
                *(f"{row[kind]:.1f}" for kind in (*KINDS, "bytes")),
                f"{row['samples a second'] / 1e9:.0f}",
                row["bound by"],
            ]
            for number, (name, row) in enumerate(rows.items(), start=1)
        ],
        groups=[("operations of a sample", 2, 5)],
        widths=[0.4, 2.6, 1, 1, 1, 1, 1, 1.8, 1.6],
    )
    return figure


def _roofline(axes: Axes, rows: dict[str, dict], exact: list[str]) -> None:
    """Draw ceilings, and each program at the rate of all its operations that the bound leaves."""
    axes.set(xscale="log", yscale="log")
    axes.minorticks_off()
    intensity = np.geomspace(2, 64, 100)
    for kind, line, title in (
        ("issue", "-", "float32, or all kinds together"),
        ("integer", "--", "integers only"),
    ):
        peak = H100.peak(kind) / TERA
        axes.plot(intensity, np.minimum(intensity * H100.bandwidth / TERA, peak), line, color="black", lw=1)
        axes.text(64, peak * 1.03, f"{title}: {peak:.1f}", ha="right", fontsize=8)
    axes.text(2.1, 11.5, f"memory: {H100.bandwidth / TERA:g} TB/s", fontsize=8)
    along = sorted(rows, key=lambda name: rows[name]["operations a byte"])
    order, images = [name for name in along if name in exact], [name for name in along if name not in exact]
    for number, (name, row) in enumerate(rows.items(), start=1):
        x, y = row["operations a byte"], row["samples a second"] * sum(row[kind] for kind in KINDS) / TERA
        look = POINTS if name in exact else IMAGES
        axes.plot(x, y, look.marker, color=look.color, ms=5)
        # Points have theirs above and below in turns, images to the right and left: neighbours are close.
        if name in exact:
            offset = (0, -10) if order.index(name) % 2 else (0, 8)
        else:
            offset = (-9, 0) if images.index(name) % 2 else (8, 5)
        axes.annotate(
            str(number), (x, y), offset, textcoords="offset points", fontsize=8, ha="center", va="center"
        )
    for look, title in ((POINTS, "points, kept"), (IMAGES, "images")):
        axes.plot([], [], look.marker, color=look.color, label=title)
    axes.set(xlabel="operations a byte", ylabel="$10^{12}$ operations a second", xlim=(2, 64), ylim=(6, 45))
    for axis, ticks in ((axes.set_xticks, (2, 4, 8, 16, 32, 64)), (axes.set_yticks, (8, 16, 32))):
        axis(ticks, [str(tick) for tick in ticks])
    axes.legend(loc="lower right", frameon=False)
    axes.grid(alpha=0.3)
