"""Search for the components of Joe and Kuo's sequence that make a cascaded net of small t.

``python -m analysis.tables.make_cascade`` prints the tuple in
``qmcjax/sequences/_digital/constructions.py`` (minutes).

The components are chosen greedily, dimension by dimension. The cost is the sum over m of the square of t of
all pairs with a previous dimension, and of the last three and four dimensions together. Adjacent pairs
have t = 0 for any component. No pair is left out: a component that is repeated eventually makes the same
dimensions again.
"""

import numpy as np
from numpy.typing import NDArray

from analysis import t_value
from qmcjax.sequences import sobol

DIMS = 32
COMPONENTS = 60
SIZES = range(4, 15)


def following(columns: NDArray[np.uint32], m: int, matrix: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the columns of a dimension from those of the previous one: its points are the indices."""
    digits = columns[:, None] >> np.uint32(32 - m) >> np.arange(m, dtype=np.uint32) & np.uint32(1)
    return np.bitwise_xor.reduce(digits * matrix[:m], axis=1)


def cost(nets: dict[int, list[NDArray[np.uint32]]], most: float) -> float:
    """Return the cost of the last dimension, or a partial cost that reached ``most``."""
    last = len(nets[SIZES[0]]) - 1
    sets = [(j, last) for j in range(last - 2, -1, -1)]
    sets += [tuple(range(last - k, last + 1)) for k in (2, 3) if last >= k]
    total = 0
    for dims in sets:
        total += sum(t_value(_words([net[j] for j in dims]), m=m) ** 2 for m, net in nets.items())
        if total >= most:
            break
    return total


def _words(columns: list[NDArray[np.uint32]]) -> NDArray[np.uint32]:
    """Return columns as :func:`analysis.t_value` takes them, 32 of each dimension."""
    return np.pad(np.stack(columns), ((0, 0), (0, 32 - len(columns[0]))))


def main() -> None:
    """Print the components."""
    matrices = np.asarray(sobol(COMPONENTS + 1).matrices)
    nets = {m: [np.uint32(1) << np.arange(32 - m, 32, dtype=np.uint32)] for m in SIZES}
    chosen: list[int] = []
    while len(chosen) < DIMS - 1:
        least, best = np.inf, (0, nets)
        for component in range(1, COMPONENTS + 1):
            tried = {m: [*net, following(net[-1], m, matrices[component])] for m, net in nets.items()}
            found = cost(tried, least)
            if found < least:
                least, best = found, (component, tried)
        component, nets = best
        chosen.append(component)
        print(component, least, flush=True)
    print(tuple(chosen))


if __name__ == "__main__":
    main()
