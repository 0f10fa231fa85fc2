"""Times of Mitsuba 3 with its samplers and ours, in a process of its own.

A task has a variant, the names of samplers, the side of images, samples per pixel, and the number of turns.
"""

from typing import Any

from figures.shared import turns
from figures.shared.mitsuba_runs import mitsuba_samplers_process as samplers
from figures.shared.mitsuba_runs.mitsuba_scenes import Run
from qmcjax.bridges import mitsuba as bridge

SCENE, KEY = "Cornell box", 1
"""With paths of up to 8 edges."""

MODES = {"symbolic": True, "evaluated": False}


def measured(task: dict[str, Any]) -> dict[str, dict[str, list[float]]]:
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
        taken = turns.in_turns(calls, task["turns"])
        found[mode] = {name: [of[0].clock, turns.median(of)] for name, of in taken.items()}
    return found


def _call(mitsuba: Any, drjit: Any, name: str, symbolic: bool, side: int, spp: int) -> Any:
    scene = samplers.loaded(mitsuba, SCENE, side, Run(name, spp, KEY))

    def call(turn: int) -> float:
        with drjit.scoped_set_flag(drjit.JitFlag.SymbolicLoops, symbolic):
            image = mitsuba.render(scene, spp=spp)
        drjit.eval(image)
        drjit.sync_thread()
        return 0.0

    return call
