"""Images by Mitsuba 3 with its samplers and ours, and their times, in a separate process.

Images: ``python -m`` and the name of this module. The task comes in JSON at standard input: the name of a
scene, a side, runs, and the file for the result. Times: `measure`. The task has a variant, the names of
samplers, the side of images, samples per pixel, and the number of turns.
"""

import json
import sys
from typing import Any

import numpy as np

from figures.shared import costs
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.mitsuba_runs.mitsuba_scenes import Run
from qmcjax.bridges import mitsuba as bridge
from qmcjax.choosing import CANDIDATES

DIMS = 8
"""Of each sampler: the pixel's, the lens', and those of a bounce. The plug-in pads what is behind them."""


OURS = {"(0,2), Owen per pixel": "(0,2), Owen"} | {
    name: name for name in ("Hilbert, Owen-Sobol'", "Hilbert, Halton (2,3)", "Z, hash", "optimised orders")
}
"""Names of candidates."""

THEIRS = ("independent", "stratified", "multijitter")


def cornell_box(mitsuba: Any) -> dict[str, Any]:
    """Return the Cornell box as Mitsuba has it."""
    return mitsuba.cornell_box()


def glossy(mitsuba: Any) -> dict[str, Any]:
    """Return rough metal and varnish on a rough floor, below two lamps and a sky."""
    place = mitsuba.ScalarTransform4f
    floor = _rough("Cr", 0.2)
    lamps = {
        f"lamp{k}": {
            "type": "sphere",
            "center": center,
            "radius": 0.45,
            "emitter": {"type": "area", "radiance": _rgb(*radiance)},
        }
        for k, (center, radiance) in enumerate(
            (([-2.8, 3.0, 0.6], (9.0, 7.0, 5.0)), ([2.8, 2.6, 1.0], (4.0, 6.0, 9.0)))
        )
    }
    varnish = {"type": "roughplastic", "diffuse_reflectance": _rgb(0.6, 0.1, 0.08), "alpha": 0.1}
    balls = {
        f"ball{k}": {"type": "sphere", "center": [x, 0.6, z], "radius": 0.6, "bsdf": bsdf}
        for k, (x, z, bsdf) in enumerate(
            ((-1.35, 0.0, _rough("Au", 0.1)), (0.0, 0.35, varnish), (1.35, -0.1, _rough("Cu", 0.3)))
        )
    }
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4},
        "sensor": {
            "type": "perspective",
            "fov": 40.0,
            "to_world": place().look_at([0, 3.6, 4.6], [0, 0.25, 0], [0, 1, 0]),
        },
        "floor": {
            "type": "rectangle",
            "to_world": place().rotate([1, 0, 0], -90) @ place().scale(6),
            "bsdf": floor,
        },
        "sky": {"type": "constant", "radiance": _rgb(0.25, 0.3, 0.4)},
        **lamps,
        **balls,
    }


def depth_of_field(mitsuba: Any) -> dict[str, Any]:
    """Return a row of balls on a checkerboard, the third in focus of a wide lens."""
    place = mitsuba.ScalarTransform4f
    colors = ((0.8, 0.3, 0.2), (0.8, 0.6, 0.2), (0.3, 0.7, 0.3), (0.2, 0.5, 0.8), (0.6, 0.3, 0.7))
    balls = {
        f"ball{k}": {
            "type": "sphere",
            "center": [0.6 * (k - 2), 0.4, 2.0 - 1.3 * k],
            "radius": 0.4,
            "bsdf": {"type": "diffuse", "reflectance": _rgb(*color)},
        }
        for k, color in enumerate(colors)
    }
    board = {
        "type": "checkerboard",
        "color0": _rgb(0.15, 0.15, 0.15),
        "color1": _rgb(0.75, 0.75, 0.75),
        "to_uv": place().scale([12, 12, 1]),
    }
    origin, target = [1.2, 2.9, 5.0], [0.1, 0.2, -0.6]
    distance = float(np.linalg.norm(np.subtract(origin, target)))
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "sensor": {
            "type": "thinlens",
            "fov": 36.0,
            "aperture_radius": 0.25,
            "focus_distance": distance,
            "to_world": place().look_at(origin, target, [0, 1, 0]),
        },
        "floor": {
            "type": "rectangle",
            "to_world": place().rotate([1, 0, 0], -90) @ place().scale(8),
            "bsdf": {"type": "diffuse", "reflectance": board},
        },
        "lamp": {
            "type": "rectangle",
            "to_world": place().translate([0, 4, 1]) @ place().rotate([1, 0, 0], 90),
            "emitter": {"type": "area", "radiance": _rgb(6.0, 5.6, 5.0)},
        },
        "sky": {"type": "constant", "radiance": _rgb(0.3, 0.4, 0.5)},
        **balls,
    }


SCENES = {"Cornell box": cornell_box, "glossy": glossy, "depth of field": depth_of_field}


def _rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


def _rough(metal: str, alpha: float) -> dict[str, Any]:
    return {"type": "roughconductor", "material": metal, "alpha": alpha}


def load(mitsuba: Any, name: str, side: int, run: Run) -> Any:
    """Return a scene with the sampler of an image."""
    described = SCENES[name](mitsuba)
    film = mitsuba.load_dict(mitsuba_scenes.film(side, side))
    plug_in: dict[str, Any] = {"type": run.sampler}
    if run.sampler in OURS:
        made = CANDIDATES[OURS[run.sampler]].make(DIMS, side, side, run.spp, run.seed)
        plug_in = {"type": "qmcjax", "sampler": bridge.wrap(made), "film": film, "key": run.seed}
    described["sensor"] |= {"film": film, "sampler": plug_in}
    return mitsuba.load_dict(described)


SCENE, KEY = "Cornell box", 1
"""With paths of up to 8 edges."""

MODES = {"symbolic": True, "evaluated": False}


def measure(task: dict[str, Any]) -> dict[str, dict[str, list[float]]]:
    """Return first and median seconds of images, by modes and samplers: all samplers take turns."""
    bridge.register(task["variant"])
    import drjit  # pyright: ignore[reportMissingImports]
    import mitsuba  # pyright: ignore[reportMissingImports]

    modes = {"": True} if task["variant"].startswith("scalar") else MODES
    found = {}
    for mode, symbolic in modes.items():
        # In each mode all is made anew: the first image is the first one.
        calls = {
            name: _call(mitsuba, drjit, name, symbolic, task["side"], task["spp"])
            for name in task["samplers"]
        }
        taken = costs.in_turns(calls, task["turns"])
        found[mode] = {name: [of[0].clock, costs.median(of)] for name, of in taken.items()}
    return found


def _call(mitsuba: Any, drjit: Any, name: str, symbolic: bool, side: int, spp: int) -> Any:
    scene = load(mitsuba, SCENE, side, Run(name, spp, KEY))

    def call(turn: int) -> float:
        with drjit.scoped_set_flag(drjit.JitFlag.SymbolicLoops, symbolic):
            image = mitsuba.render(scene, spp=spp)
        drjit.eval(image)
        drjit.sync_thread()
        return 0.0

    return call


def main() -> None:
    """Render with the scalar variant, which runs wherever Mitsuba does."""
    task = json.load(sys.stdin)
    bridge.register("scalar_rgb")
    import mitsuba  # pyright: ignore[reportMissingImports]

    images = []
    for run in (Run(*given) for given in task["runs"]):
        scene = load(mitsuba, task["scene"], task["side"], run)
        # The key of ours is the sampler's.
        seed = 0 if run.sampler in OURS else run.seed
        image: Any = mitsuba.render(scene, spp=run.spp, seed=seed)  # pyright: ignore[reportArgumentType]
        images.append(np.array(image, np.float32))
    np.savez(task["file"], images=np.array(images))


if __name__ == "__main__":
    main()
