"""Wrong nouns in all arguments of all public functions of sequences: errors that name the argument."""

import inspect
from pathlib import Path

import jax
import numpy as np
import pytest
from scipy.stats import qmc

from qmcjax import orders, samplers, scenes, sequences

RIGHT = {
    "a": 3,
    "base": 7,
    "candidates": 2,
    "component": 0,
    "dims": 2,
    "f": sequences.halton(2),
    "index": 1,
    "initial": [1],
    "iterations": 1,
    "key": 1,
    "log_side": 1,
    "m": 4,
    "matrices": np.asarray(sequences.sobol(2).matrices),
    "modified": 0,
    "n": 8,
    "name": "x",
    "net": sequences.hammersley_net(4),
    "numbers": [(0b111, [1, 3])],
    "offset_or_key": 1,
    "path": (Path(__file__).parents[1] / "direction_numbers.txt"),
    "permutation": "faure",
    "points": [[0.5, 0.5]],
    "polynomial": 3,
    "q": 2,
    "radius": 0.5,
    "replacement": np.eye(3, dtype=int),
    "row": 1,
    "sequence": sequences.sobol(2),
    "side": 2,
    "steps": [0.25, 0.7],
    "value": sequences.sobol(2),
}
OTHERS = {
    ("components", "dims"): (1, 0),
    ("replace_component", "matrices"): np.stack(
        [np.eye(3, dtype=int), np.array([[1, 1, 1], [0, 1, 0], [0, 0, 1]])]
    ),
    ("halton", "key"): None,
    ("record_net", "n"): 16,
}
WRONG = {
    "scene": scenes.checkerboard(),
    "order": orders.hilbert(4, 4),
    "sampler": samplers.independent(sequences.sobol(2), 1),
    "sequence": sequences.hammersley_net(3),
    "engine": qmc.Sobol(2),
    "None": None,
    "string": "sobol",
    "tuple": (512, 512),
    "list": [1, [2, 3]],
    "floats": np.zeros((2, 3)),
    "nan": float("nan"),
    "complex": 1j,
    "negative": -1,
    "bool": True,
    "dict": {"a": 1},
    "class": dict,
    "function": lambda: None,
    "keys": jax.random.split(jax.random.key(1)),
}
FUNCTIONS = [name for name in vars(sequences) if name[0].islower() and callable(getattr(sequences, name))]


def right(function, argument):
    return OTHERS.get((function, argument), RIGHT[argument])


def call(name, **changed):
    """Call a function with right arguments but some."""
    parameters = inspect.signature(getattr(sequences, name)).parameters
    return getattr(sequences, name)(**{p: right(name, p) for p in parameters} | changed)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_wrong_arguments_are_named(name):
    call(name)
    for argument in inspect.signature(getattr(sequences, name)).parameters:
        if argument == "name":  # That of another argument, "value".
            continue
        for kind, wrong in WRONG.items():
            try:
                call(name, **{argument: wrong})
            except OSError:
                assert argument == "path", (argument, kind)
            except (TypeError, ValueError) as error:
                named = {"value": RIGHT["name"]}.get(argument, argument)
                assert str(error).startswith(named) or f" {named} " in str(error), (argument, kind, error)
