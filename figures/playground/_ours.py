"""The playground of the first page: a dozen samplers on scenes with exact images."""

from functools import partial

from figures.playground._data import Playground, playground
from figures.shared.rivals import CLOSED, RIVALS
from qmcjax import samplers

SAMPLERS = {rival.name: rival for name, rival in RIVALS.items() if name != "hilbert-halton"}
"""All but one with 57 kB of program and tables."""

SCENES = {name.replace("-", " "): make for name, make in CLOSED.items()}

COUNTS = (1, 4, 16, 64, 256)

DIMS = 4
"""As many as one of the scenes needs."""

START = {"left": RIVALS["random"].name, "right": RIVALS["z"].name, "scene": "ball", "spp": 16}


def made(name: str, side: int, count: int, key: int) -> samplers.Sampler:
    """Return one of the samplers."""
    return SAMPLERS[name].make(DIMS, side, side, count, key)


def ours(side: int) -> Playground:
    """Return the playground with our samplers, for square images."""
    worlds = {name: make() for name, make in SCENES.items()}
    exact = {name: (scene, scene.reference(side, side)[0]) for name, scene in worlds.items()}
    makers = {name: partial(made, name, side) for name in SAMPLERS}
    return playground(makers, exact, side, COUNTS, start=START)
