"""The playground: two samplers on a scene, rendered in the page, and what stands there where it cannot be."""

from pathlib import Path

from figures.page._html import Markup, fill, static

SCRIPT = "playground.js"
"""The file of its program, beside the page."""

PARTS = ("unpack.js", "ask.js", "accumulate.js", "measure.js", "curve.js", "playground.js")

LIVE = """
<section class="playground" aria-label="Two samplers on a scene, rendered in this page">
<div class="live" hidden></div>
<div class="still">$still</div>
</section>
<script src="$data" defer></script>
<script src="$script" defer></script>
"""


def script() -> str:
    """Return the program of playgrounds, which needs that of the viewer."""
    return "\n".join(static(f"playground/{name}") for name in PARTS)


def playground(folder: Path, data: str, still: Markup | str) -> Markup | str:
    """Return a playground in place of something that is still; just that without the file of its data."""
    if not (folder / data).is_file():
        return still
    return fill(LIVE, data=data, script=SCRIPT, still=still)
