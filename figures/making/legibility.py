"""Faults that make a figure illegible in print: width, small or overlapping text, axes without names."""

from itertools import combinations
from typing import Any

SMALLEST = 7.5
"""Font size in points."""

TALLEST = 9.5
"""Inches, the height of a page."""

TOLERATED = 1.5
"""Pixels by which the boxes of texts may overlap: they are wider than the printed letters."""


def faults(figure: Any) -> list[str]:
    """Return the faults of a figure that has been drawn, at its own resolution."""
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    from figures._rc import COLUMN, PAGE

    width, height = figure.get_size_inches()
    wrong = []
    if min(abs(width - COLUMN), abs(width - PAGE)) > 0.01 or height > TALLEST:
        wrong.append(f"{width:.2f} x {height:.2f} inches")
    axes = [each for each in figure.findobj(Axes) if each.get_visible()]
    hidden = {id(text) for each in axes for text in _hidden_ticks(each)}
    texts = [
        text
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and id(text) not in hidden
    ]
    wrong += [
        f"{_quote(text)} has {text.get_fontsize():g} pt" for text in texts if text.get_fontsize() < SMALLEST
    ]
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes = [(text, _box(text, renderer)) for text in texts]
    edge = figure.bbox
    wrong += [
        f"{_quote(text)} leaves the figure"
        for text, box in boxes
        if min(box.x0, box.y0, edge.x1 - box.x1, edge.y1 - box.y1) < -TOLERATED
    ]
    wrong += [
        f"{_quote(first)} overlaps {_quote(second)}"
        for (first, a), (second, b) in combinations(boxes, 2)
        if min(a.x1, b.x1) - max(a.x0, b.x0) > TOLERATED and min(a.y1, b.y1) - max(a.y0, b.y0) > TOLERATED
    ]
    return wrong + [fault for each in axes if each.axison for fault in _nameless(each)]


def _box(text: Any, renderer: Any) -> Any:
    """Return the box of a text without its arrow, and without empty lines at its end, which reserve room."""
    from matplotlib.text import Text

    box = Text.get_window_extent(text, renderer).frozen()
    lines, words = text.get_text().count("\n") + 1, text.get_text().rstrip("\n").count("\n") + 1
    box.y0 = box.y1 - (box.y1 - box.y0) * words / lines
    return box


def _hidden_ticks(axes: Any) -> list[Any]:
    """Return the tick labels that are not drawn: outside of the axes, or of axes that are off."""
    hidden = []
    for axis in (axes.xaxis, axes.yaxis):
        scale = axis.get_transform().transform
        low, high = sorted(scale(axis.get_view_interval()))
        slack = 1e-6 * (high - low)
        for minor in (False, True):
            places = scale(axis.get_ticklocs(minor=minor))
            for k, tick in enumerate(axis.get_minor_ticks() if minor else axis.get_major_ticks()):
                there = axes.axison and axis.get_visible() and k < len(places)
                if not (there and low - slack <= places[k] <= high + slack):
                    hidden += [tick.label1, tick.label2]
    return hidden


def _nameless(axes: Any) -> list[str]:
    """Return the axes with numbers but without a name; unit squares need none."""
    wrong = []
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        labels = [
            label.get_text()
            for place, label in zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=False)
            if low <= place <= high and label.get_visible()
        ]
        figure = axes.get_figure()
        above = getattr(figure, f"get_sup{name}label")() or getattr(figure.figure, f"get_sup{name}label")()
        numbers = [text for text in labels if any(map(str.isdigit, text))]
        if numbers and set(numbers) != {"0", "1"} and not axis.get_label_text() and not above:
            wrong.append(f"the {name} axis of {_quote(axes.title)} has no name")
    return wrong


def _quote(text: Any) -> str:
    return repr(" ".join(text.get_text().split())[:60])
