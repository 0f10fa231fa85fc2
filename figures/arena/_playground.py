"""The playground of a comparison: the user's samplers and their rivals, rendered in the page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from analysis import Comparison
from figures.making import store
from figures.page import SCRIPT, Markup, fill, join, playground, playground_script
from figures.playground import playground as translated

DATA = "playground-data.js"

SECTION = """<section id="playground"><h2>Playground</h2>
<p class="lead">Any two of these samplers on any of these scenes, rendered by the graphics card: the address
of the page keeps the choice.</p>
$content</section>"""

STILL = "This browser does not render in pages: that needs WebGL 2 and a current version. Images are below."


def section(compared: Comparison, worlds: Mapping[str, Any], own: Sequence[str], folder: Path) -> Markup:
    """Return the playground, and in words which samplers and scenes are not in it; write its files.

    There is none where Mitsuba rendered: the page does not have its scenes.
    """
    if not compared.makers:
        return Markup("")
    counts = sorted({row.spp for row in compared.rows} | {spp for *_, spp in compared.left_out})
    side = len(next(iter(compared.references.values())))
    most_keys = max((len(row.values["RMS error"]) for row in compared.rows), default=1)
    right = next((name for name in compared.makers if name not in own), own[0])
    made = translated(
        compared.makers,
        {name: (worlds[name], reference) for name, reference in compared.references.items()},
        side,
        counts,
        range(most_keys),
        {"left": own[0], "right": right, "spp": counts[len(counts) // 2]},
    )
    live = Markup("")
    if made.script:
        store.write(folder / DATA, made.script.encode())
        store.write(folder / SCRIPT, playground_script().encode())
        live = Markup(playground(folder, DATA, fill('<p class="note">$still</p>', still=STILL)))
    missing = join(
        fill("<p>Not in the playground: $name, since $why.</p>", name=name, why=why)
        for name, why in made.left_out.items()
    )
    return fill(SECTION, content=join([live, missing]))
