"""Five pictures for newcomers: from one point per cell to the trade-off of time and error."""

from collections.abc import Mapping
from pathlib import Path

from figures.catalogue import Entry
from figures.page._figures import Shown, command, picture
from figures.page._html import Markup, fill, join

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
<section id="start" aria-labelledby="start-title"><h2 id="start-title">New here? Five pictures</h2>
<ol class="tour">$steps</ol></section>
"""

STEP = """
<li><h3>$title</h3><p>$text <a href="#$name">$name</a></p>$picture</li>
"""

NOT_MADE = """
<p class="note"><code>$command</code> makes it.</p>
"""


def section(folder: Path, figures: Mapping[str, Shown], catalogue: Mapping[str, Entry]) -> Markup:
    """Return the five pictures; nothing for another catalogue, which has none of them."""
    steps = [step for step in STEPS if step[0] in catalogue]
    if not steps:
        return Markup("")
    return fill(
        SECTION,
        steps=join(
            fill(
                STEP,
                name=name,
                title=title,
                text=text,
                picture=picture(folder, figures[name])
                if name in figures
                else fill(NOT_MADE, command=command(name)),
            )
            for name, title, text in steps
        ),
    )
