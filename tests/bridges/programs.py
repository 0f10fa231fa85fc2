"""Programs of scalars, evaluated with NumPy: the oracle of what other languages make of them."""

import numpy as np

from qmcjax.bridges._source import Compute
from qmcjax.bridges._source._operations import FOLDED


def evaluated(program, *inputs):
    """Return the outputs of a program for arrays of inputs, all of one shape."""
    shape = np.shape(inputs[0])
    values = {}

    def value(wanted):
        if wanted.kind == "constant":
            return np.broadcast_to(wanted.detail, shape)
        return inputs[wanted.detail] if wanted.kind == "input" else values[wanted]

    def run(statements):
        for statement in statements:
            if isinstance(statement, Compute):
                made = statement.value
                values[made] = computed(made, [value(argument) for argument in made.arguments])
            else:
                repeat(statement)

    def repeat(statement):
        loop, kept = statement.loop, statement.kept
        state = [np.array(value(loop.initial[n])) for n in kept]
        while True:
            values.update({loop.variables[n]: array for n, array in zip(kept, state, strict=True)})
            run(statement.head)
            going = value(loop.condition)
            if not going.any():
                break
            run(statement.body)
            state = [
                np.where(going, value(loop.following[n]), old) for n, old in zip(kept, state, strict=True)
            ]
        results.update({(loop, n): array for n, array in zip(kept, state, strict=True)})

    results = {}

    class Results(dict):
        def __missing__(self, wanted):
            return results[wanted.loop, wanted.detail]

    values = Results()
    with np.errstate(all="ignore"):
        run(program.statements)
    return [value(output) for output in program.outputs]


def computed(made, given):
    if made.kind == "load":
        return made.detail.entries[given[0]].astype(made.dtype)
    if made.kind == "select":
        return np.where(*given)
    if made.kind in ("convert", "bitcast"):
        return given[0].astype(made.dtype) if made.kind == "convert" else given[0].view(made.dtype)
    return FOLDED[made.kind](*given).astype(made.dtype)
