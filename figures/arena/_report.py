"""The page of a comparison: what was promised, who is ahead and how surely, errors, spectra, images."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import analysis
from analysis import Comparison, ComparisonRow
from figures.arena import _pictures, _playground
from figures.arena._on_mitsuba import EQUAL_TIME
from figures.making import store, this_machine, web_images
from figures.page import Markup, fill, join, quantity, static, viewer

PAGE, TABLE = "index.html", "compare.csv"

SCRIPTS = ("theme.js", "zoom.js", "viewer.js")

RANKED = ("RMS error", "filtered error", "low-frequency power", *EQUAL_TIME)

SECTION = """
<section id="scene-$name" class="part"><h2>$name</h2>
$slopes
$pictures
$images</section>
"""

PICTURE = (
    '<div class="scroll" tabindex="0" role="region" aria-label="$alt"><img src="$file" alt="$alt"></div>'
)

TABLE_TEXT = """
<div class="scroll" tabindex="0" role="region" aria-label="$label"><table class="plain">
<thead><tr>$heads</tr></thead><tbody>$rows</tbody></table></div>
"""


def write(
    compared: Comparison,
    worlds: Mapping[str, Any],
    own: Sequence[str],
    sets: Mapping[str, NDArray],
    folder: Path,
    command: str,
    notes: Sequence[str] = (),
) -> Path:
    """Write page, pictures and CSV into a folder that exists, the page last, and return its path.

    ``worlds``: scenes by their names. ``own``: names of the user's samplers, which come first. ``sets``: the
    points that the user's samplers were made of. ``command``: what was typed. ``notes``: paragraphs about how
    it was measured.
    """
    store.write(folder / TABLE, store.as_csv(_columns(compared.table())))
    scenes = list(compared.references)
    sections = join(_section(compared, scene, folder) for scene in scenes)
    sizes = dict.fromkeys(f"{of.shape[1]} x {of.shape[0]}" for of in compared.references.values())
    counts = sorted({row.spp for row in compared.rows} | {spp for *_, spp in compared.left_out})
    links = {"Promises": "promises", "Ranks": "ranks", "Points": "points"}
    links |= {"Playground": "playground"} if compared.makers else {}
    links |= {scene: f"scene-{scene}" for scene in scenes}
    machine = this_machine.machine()
    text = fill(
        static("compare.html"),
        names=", ".join(own),
        style=Markup(static("style.css")),
        script=Markup("\n".join(static(name) for name in SCRIPTS)),
        nav=join(
            fill('<a href="#$place">$name</a>', place=place, name=name) for name, place in links.items()
        ),
        sizes=", ".join(sizes),
        notes=join(fill("<p>$note</p>", note=note) for note in notes),
        keys=_keys(compared),
        counts=", ".join(map(str, counts)),
        machine=f"{machine['processor']}, {machine['cores']} cores, JAX {machine['jax']}",
        command=command,
        table=TABLE,
        promises=_promises(compared),
        playground=_playground.section(compared, worlds, own, folder),
        ranks=join(_ranks(compared, scene, own) for scene in scenes),
        points=_points(compared, sets),
        sections=sections,
    )
    store.write(folder / PAGE, text.encode())
    return folder / PAGE


def _keys(compared: Comparison) -> str:
    """Return how many images there are of each sampler, and what follows from fewer than 4."""
    counts: dict[str, int] = {}
    for row in compared.rows:
        counts[row.sampler] = max(counts.get(row.sampler, 1), len(row.values["RMS error"]))
    most = max(counts.values(), default=1)
    fewer = [name for name, count in counts.items() if count < most]
    said = quantity(most, "key") + (f" (1 for {', '.join(fewer)})" if fewer else "")
    if most < 4:
        return f"{said}: from fewer than 4 there are no intervals, and all ranks are undecided"
    return f"{said}: samplers with 1 have no interval, and undecided ranks" if fewer else said


def _columns(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return rows that all have the columns of any."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return [{name: row.get(name, "") for name in names} for row in rows]


def _table(label: str, heads: Sequence[str], rows: Sequence[Sequence[Any]]) -> Markup:
    return fill(
        TABLE_TEXT,
        label=label,
        heads=join(fill('<th scope="col">$head</th>', head=head) for head in heads),
        rows=join(
            fill("<tr>$cells</tr>", cells=join(fill("<td>$cell</td>", cell=cell) for cell in row))
            for row in rows
        ),
    )


def _promises(compared: Comparison) -> Markup:
    broken = {name: sentences for name, sentences in compared.promises.items() if sentences}
    kept = [name for name in compared.promises if name not in broken]
    parts = [
        fill(
            '<p class="warning"><b>$name</b> breaks $count: all that follows may mean nothing.</p>'
            "<ul>$items</ul>",
            name=name,
            count=quantity(len(sentences), "promise"),
            items=join(fill("<li>$sentence</li>", sentence=sentence) for sentence in sentences),
        )
        for name, sentences in broken.items()
    ]
    if kept:
        parts.append(fill("<p>Kept by $names.</p>", names=", ".join(kept)))
    return join(parts)


def _ranks(compared: Comparison, scene: str, own: Sequence[str]) -> Markup:
    counts = sorted({row.spp for row in compared.rows if row.scene == scene})
    names = list(dict.fromkeys(row.sampler for row in compared.rows if row.scene == scene))
    rows = []
    known = {measure for row in compared.rows if row.scene == scene for measure in row.values}
    for measure in (each for each in RANKED if each in known):
        ranks = {spp: compared.ranks(scene, spp, measure) for spp in counts}
        for name in names:
            cells = [_rank(ranks[spp].get(name), _row(compared, scene, name, spp), measure) for spp in counts]
            shown = fill("<b>$name</b>", name=name) if name in own else name
            rows.append([measure, shown, *cells])
    left_out = {
        f"{name} at {spp}" if why.startswith("spp") else name: why
        for (place, name, spp), why in compared.left_out.items()
        if place == scene
    }
    missing = join(
        fill("<p>Left out: $name, since $why.</p>", name=name, why=why) for name, why in left_out.items()
    )
    heads = ["measure", "sampler", *(f"{spp} spp" for spp in counts)]
    return join([fill("<h3>$scene</h3>", scene=scene), _table(f"Ranks on {scene}", heads, rows), missing])


def _row(compared: Comparison, scene: str, name: str, spp: int) -> ComparisonRow | None:
    return next((r for r in compared.rows if (r.scene, r.sampler, r.spp) == (scene, name, spp)), None)


def _rank(rank: tuple[int, int, int] | None, row: ComparisonRow | None, measure: str) -> str:
    if rank is None or row is None:
        return "–"
    least, most = rank[1:]
    between = f"{least}" if least == most else f"{least}–{most}"
    return f"{rank[0]} ({between}), {row.mean(measure):.4g}"


def _points(compared: Comparison, sets: Mapping[str, NDArray]) -> Markup:
    measures = list(
        dict.fromkeys(measure for of in compared.points.values() for each in of.values() for measure in each)
    )
    rows = [
        [name, spp, *(f"{measured[measure]:.4g}" if measure in measured else "–" for measure in measures)]
        for name, of in compared.points.items()
        for spp, measured in of.items()
    ]
    whole = join(fill("<p>$text</p>", text=_of_set(name, points)) for name, points in sets.items())
    if not rows:
        return whole or fill("<p>Not measured for scenes of Mitsuba.</p>")
    return join([_table("Measures of points", ["sampler", "spp", *measures], rows), whole])


def _of_set(name: str, points: NDArray) -> str:
    n, dims = points.shape
    if dims == 2:
        discrepancy = f"star discrepancy {analysis.star_discrepancy(points):.4g}"
    else:
        lower, upper = analysis.star_discrepancy_bounds(points)
        discrepancy = f"star discrepancy between {lower:.4g} and {upper:.4g}"
    distance = f", minimum distance on the torus {analysis.min_distance(points):.4g}" if n > 1 else ""
    return f"The whole set {name}: {n} points in {dims} dimensions, {discrepancy}{distance}."


def _section(compared: Comparison, scene: str, folder: Path) -> Markup:
    rows = [row for row in compared.rows if row.scene == scene]
    if not rows:
        return fill(SECTION, name=scene, slopes="Nothing was rendered: see above.", pictures="", images="")
    drawn = {"errors": _pictures.errors(compared, scene), "spectra": _pictures.spectra(compared, scene)}
    pictures = []
    for what, png in drawn.items():
        if png is not None:
            file = f"{scene}.{what}.png"
            store.write(folder / file, png)
            pictures.append(fill(PICTURE, file=file, alt=f"{what} of all samplers on {scene}"))
    images = {"reference": compared.references[scene]}
    images |= {f"{row.sampler}, {row.spp} spp": row.image for row in rows}
    files, description = web_images.encode(images)
    for name, png in files.items():
        store.write(folder / f"{scene}.{name}", png)
    return fill(
        SECTION,
        name=scene,
        slopes=_slopes(compared, scene),
        pictures=join(pictures),
        images=viewer(folder, scene, scene, description),
    )


def _slopes(compared: Comparison, scene: str) -> Markup:
    rows = []
    for name in dict.fromkeys(row.sampler for row in compared.rows if row.scene == scene):
        seconds = [
            f"{row.seconds * 1e3:.3g}" for row in compared.rows if (row.scene, row.sampler) == (scene, name)
        ]
        try:
            slope, low, high = compared.slope(scene, name)
        except ValueError:
            rows.append([name, "–", ", ".join(seconds)])
        else:
            between = f"{low:.2f} to {high:.2f}" if np.isfinite(low) else "no interval"
            rows.append([name, f"{slope:.2f} ({between})", ", ".join(seconds)])
    return _table(f"Slopes on {scene}", ["sampler", "slope of the RMS error", "milliseconds an image"], rows)
