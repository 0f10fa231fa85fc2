"""Images that a figure hands out: side by side with a split, magnified, their differences and spectra."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from figures.making import store
from figures.page._html import Markup, fill, join, script_safe

VIEWER = """
<section class="viewer" aria-label="Images of $name side by side" data-name="$name" data-title="$title">
<script type="application/json">$images</script>
</section>
"""

WALL = """
<div class="wall wide" style="--width: 1370px" data-name="$name" data-title="$title">
<script type="application/json">$images</script></div>
"""

LOST = '<p class="warning">Images are missing: $files</p>'


def shown(folder: Path, name: str, title: str, images: Mapping[str, Any] | None) -> Markup:
    """Return a viewer, and a wall above it for a series over several counts; nothing for no images."""
    if images is None:
        return Markup("")
    counts = {item["spp"] for item in images["items"] if "spp" in item}
    series = [wall(folder, name, title, images)] * (len(counts) > 1)
    return join([*series, viewer(folder, name, title, images)])


def viewer(folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    """Return what the page's script makes a viewer of."""
    return _component(VIEWER, folder, name, title, images)


def wall(folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    """Return what the page's script makes a wall of: all samplers at as many samples as a slider says."""
    return _component(WALL, folder, name, title, images)


def _component(template: str, folder: Path, name: str, title: str, images: Mapping[str, Any]) -> Markup:
    lost = [file for file in store.image_files(name, {"images": images}) if not (folder / file).is_file()]
    if lost:
        return fill(LOST, files=", ".join(lost))
    data = json.dumps(images, ensure_ascii=False, separators=(",", ":"))
    return fill(template, name=name, title=title, images=script_safe(data))
