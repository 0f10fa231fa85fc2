"""Five pictures for newcomers: from one point per cell to the trade-off of time and error."""

from collections.abc import Mapping
from pathlib import Path

from figures.page._figures import Shown, not_made, picture
from figures.page._html import Markup, fill, join
from figures.page._places import href

STEPS = (
    (
        "thesis-5.2",
        "One point in each cell",
        "Random points clump and leave holes. A net puts exactly one point into each cell of a grid, and "
        "into each box of the same area, however flat: so it sees an edge in any place about as often as it "
        "should.",
    ),
    (
        "hilbert-1",
        "A path over the pixels",
        "An image needs such points in each of its pixels. If one sequence is dealt out along a curve that "
        "stays among neighbours, the points of nearby pixels complete each other.",
    ),
    (
        "z-1",
        "The same amount of noise, arranged",
        "At one sample per pixel every sampler has noise. But where neighbours err in opposite directions, "
        "errors cancel to the eye: the spectrum is dark in its middle, which is called blue noise.",
    ),
    (
        "thesis-6.2",
        "More samples, less error, at different rates",
        "Random samples halve the error with four times the work. Stratified ones and nets fall on steeper "
        "lines, so that their advantage grows with the number of samples.",
    ),
    (
        "benchmark",
        "What a user pays: time",
        "A sampler that takes longer for a point must save samples. Error over run time shows which one is "
        "worth it: what lies lower and farther to the left wins.",
    ),
)

SECTION = """
<section id="start" aria-labelledby="start-title"><h2 id="start-title">Five pictures</h2>
<ol class="tour">$steps</ol></section>
"""

STEP = """
<li><h3>$title</h3><p>$text <a href="$place">$name</a></p>$picture</li>
"""


def section(folder: Path, figures: Mapping[str, Shown]) -> Markup:
    """Return the five pictures; nothing for another catalogue, which has none of them."""
    steps = [
        fill(
            STEP,
            name=name,
            place=href(name),
            title=title,
            text=text,
            picture=not_made(name) if figures[name].entry is None else picture(folder, figures[name]),
        )
        for name, title, text in STEPS
        if name in figures
    ]
    return fill(SECTION, steps=join(steps)) if steps else Markup("")
