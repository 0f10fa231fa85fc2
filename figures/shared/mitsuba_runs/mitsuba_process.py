"""Images by Mitsuba 3, from a task in JSON at standard input: ``python -m`` and the name of this module.

The task has a scene, samples per pixel and seeds (see :mod:`.mitsuba_scenes`), and a folder for the result.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

RESULT = "result.npz"
"""Has ``images``, float32 (seeds, height, width, 3), and ``seconds`` of each."""


def main() -> None:
    """Render with the scalar variant: others need an LLVM of the right version, or abort the process."""
    import mitsuba  # pyright: ignore[reportMissingImports]

    mitsuba.set_variant("scalar_rgb")
    task = json.load(sys.stdin)
    folder = Path(task["folder"])
    scene = mitsuba.load_dict(as_native(mitsuba, task["scene"], folder))
    images, seconds = [], []
    for seed in task["seeds"]:
        start = time.perf_counter()
        image = mitsuba.render(scene, spp=task["spp"], seed=seed)
        seconds.append(time.perf_counter() - start)
        images.append(np.array(image, np.float32))
    np.savez(folder / RESULT, images=np.array(images), seconds=np.array(seconds))


def as_native(mitsuba: Any, value: Any, folder: Path) -> Any:
    """Return a description with Mitsuba's own matrices, and triangles in files."""
    if not isinstance(value, dict):
        return value
    if value.get("type") == "matrix":
        return mitsuba.ScalarTransform4f(np.array(value["rows"]))
    native = {key: as_native(mitsuba, part, folder) for key, part in value.items()}
    if "triangles" in native:
        native["filename"] = str(_ply(native.pop("triangles"), folder))
    return native


def _ply(triangles: list[Any], folder: Path) -> Path:
    """Write a mesh whose triangles share vertices, so that an edge of two of them is one edge."""
    path = folder / f"{len(list(folder.iterdir()))}.ply"
    corners: dict[tuple[float, ...], int] = {}
    faces = [[corners.setdefault(tuple(corner), len(corners)) for corner in each] for each in triangles]
    head = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(corners)}",
        *(f"property float {name}" for name in "xyz"),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    points = [" ".join(f"{number:.9g}" for number in corner) for corner in corners]
    rows = [f"3 {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join([*head, *points, *rows]) + "\n")
    return path


if __name__ == "__main__":
    main()
