"""Scenes of moving edges for Mitsuba's ``direct_projective``, and its derivative images."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from figures.making import this_machine
from figures.ours.edge_scenes import SCENES
from figures.shared.mitsuba_runs import mitsuba_edges_process, mitsuba_scenes
from qmcjax import tracing
from qmcjax.bridges import mitsuba

LACKS = "shard through sheet", "flight", "mirror"
"""Scenes without its derivatives: of edges where surfaces cut each other, in motion, in mirrors."""

STEP = 1e-2
"""Of the central difference that says what moves."""


def runs() -> bool:
    """Return whether Mitsuba's LLVM variants render here."""
    try:
        mitsuba.check_llvm()
    except (ImportError, RuntimeError):
        return False
    return True


def derivatives(
    name: str, side: int, counts: tuple[int, ...], keys: int
) -> tuple[NDArray, list[list[float]]]:
    """Return derivatives with respect to a scene's first parameter, and seconds, for numbers of samples.

    Where there are shadows, any number takes seconds: only the largest is measured.
    """
    scene = SCENES[name]
    shadows = "light_u" in scene.lines
    described = [_described(scene.at(scene.start.at[0].add(move), ()), side) for move in (0.0, -STEP, STEP)]
    with tempfile.TemporaryDirectory() as folder:
        task: dict[str, Any] = dict(zip(("scene", "before", "after"), described, strict=True)) | {
            "step": STEP, "shadows": shadows, "counts": counts[-1 if shadows else 0 :],
            "keys": keys, "file": str(Path(folder, "images.npz")),
        }  # fmt: skip
        seconds = this_machine.measure_apart(mitsuba_edges_process, task)
        with np.load(task["file"]) as result:
            return result["images"].astype(np.float64), seconds


def _described(scene: tracing.DirectLight, side: int) -> dict[str, Any]:
    """Return the description of a scene whose emitters shine to the side of their normals."""
    objects = scene.world.objects
    glowing = {
        f"object{number}_": item.material.radiance
        for number, item in enumerate(objects)
        if isinstance(item.material, tracing.Emitter)
    }
    meshes = [replace(item, shapes=tuple(map(_mesh, item.shapes))) for item in objects]
    black = [replace(item, material=tracing.diffuse(0.0)) if isinstance(item.material, tracing.Emitter)
             else item for item in meshes]  # fmt: skip
    made = mitsuba_scenes.describe(replace(scene, world=tracing.world(black, scene.world.lights)), side, side)
    for part, of in made.items():
        for start, color in glowing.items():
            if part.startswith(start):
                value = np.broadcast_to(np.asarray(color, np.float64), 3).tolist()
                of["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": value}}
    return made


def _mesh(shape: tracing.Shape) -> tracing.Shape:
    """Return boxes as meshes: Mitsuba's cube has six faces, and counts its edges twice."""
    if not isinstance(shape, tracing.Box):
        return shape
    corner = np.arange(8)[:, None] >> np.arange(3) & 1
    points = np.where(corner[:, None], shape.high, shape.low).swapaxes(0, 1).astype(np.float32)
    around = [[k for k in (0, 1 << a, 1 << a | 1 << b, 1 << b)] for a, b in ((0, 1), (1, 2), (2, 0))]
    faces = [[k + side for k in of] for of, side in zip(around * 2, (0, 0, 0, 4, 1, 2), strict=True)]
    halves = [[of[0], of[j], of[j + 1]] for of in faces for j in (1, 2)]
    return tracing.triangles(points[:, halves].reshape(-1, 3, 3)).shapes[0]
