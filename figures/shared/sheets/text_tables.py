"""Tables in figures: columns of text between three rules."""

from collections.abc import Sequence

from matplotlib.axes import Axes


def draw(
    axes: Axes,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    groups: Sequence[tuple[str, int, int]] = (),
    widths: Sequence[float] | None = None,
) -> None:
    """Write rows of cells below the heads of their columns, flush right.

    ``groups`` are titles over columns from one to another, ``widths`` relative.
    """
    wide = widths or [1.0] * len(heads)
    ends = [sum(wide[: k + 1]) for k in range(len(wide))]
    for k, (end, head) in enumerate(zip(ends, heads, strict=True)):
        axes.text(end, -0.5, head, ha="right", va="center", fontsize=9, weight="bold")
        for row, cells in enumerate(rows, start=1):
            axes.text(end, -row - 0.6, cells[k], ha="right", va="center", fontsize=9)
    for title, first, last in groups:
        left, right = ends[first] - 0.9 * wide[first], ends[last]
        axes.text((left + right) / 2, 0.55, title, ha="center", va="center", fontsize=9)
        axes.plot([left, right], [0.1, 0.1], color="black", lw=0.6)
    bottom = -len(rows) - 1.2
    for y, width in ((1.1 if groups else 0.1, 1.2), (-1.05, 0.6), (bottom, 1.2)):
        axes.plot([0, ends[-1]], [y, y], color="black", lw=width)
    axes.set(xlim=(0, ends[-1]), ylim=(bottom - 0.1, 1.2))
    axes.set_axis_off()
