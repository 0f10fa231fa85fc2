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
    path = folder / f"{len(list(folder.iterdir()))}.ply"
    vertices = np.array(triangles, np.float64).reshape(-1, 3)
    head = [
        "ply",
        "format ascii 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in "xyz"),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    corners = [" ".join(f"{number:.9g}" for number in vertex) for vertex in vertices]
    faces = [f"3 {3 * row} {3 * row + 1} {3 * row + 2}" for row in range(len(triangles))]
    path.write_text("\n".join([*head, *corners, *faces]) + "\n")
    return path


if __name__ == "__main__":
    main()
