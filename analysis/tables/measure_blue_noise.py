"""Print the table of the README beside the masks: ``python -m analysis.tables.measure_blue_noise``."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from analysis import filtered_error, low_frequency_power
from qmcjax import samplers, sequences

SIDE = 256
COUNTS = (1, 4, 16)

CENTRE = np.array([0.4, 0.55, 0.5, 0.45])

Integrand = Callable[[NDArray[np.float64]], NDArray[np.float64]]
INTEGRANDS: dict[str, Integrand] = {
    "product": lambda p: p.prod(axis=-1),
    "ball": lambda p: 1.0 * (np.square(p - 0.5).sum(axis=-1) < 0.4**2),
    "half": lambda p: 1.0 * (p.sum(axis=-1) < p.shape[-1] / 2),
    "bump": lambda p: np.exp(-10 * np.square(p - CENTRE[: p.shape[-1]]).sum(axis=-1)),
}


def methods() -> dict[str, samplers.Sampler]:
    """Return the samplers that are compared."""
    sobol = sequences.sobol(2)
    return {
        "independent, Owen": samplers.independent(sobol, 3),
        "independent, rotated": samplers.independent(sobol, 3, "shift"),
        "dither, numbers": samplers.dither(samplers.blue_noise_mask(1), sobol),
        "dither, vectors": samplers.dither(samplers.blue_noise_mask(2), sobol),
        "dither, vectors, lattice": samplers.dither(samplers.blue_noise_mask(2), sequences.lattice(2)),
        "ranked": samplers.ranked(2, 0),
        "independent, Owen, 3-D": samplers.independent(sequences.sobol(3), 3),
        "ranked, 3-D": samplers.ranked(3, 0),
        "independent, Owen, 4-D": samplers.independent(sequences.sobol(4), 3),
        "ranked, 4-D": samplers.ranked(4, 0),
    }


def row(sampler: samplers.Sampler, integrand: Integrand) -> list[str]:
    """Return low-frequency powers, then filtered errors, for each number of samples."""
    pixel, dims = jnp.arange(SIDE, dtype=jnp.uint32), tuple(range(sampler.dims))
    total = np.zeros((SIDE, SIDE))
    low, filtered = [], []
    for s in range(max(COUNTS)):
        total += integrand(np.asarray(sampler(pixel[None, :], pixel[:, None], s, dims, jnp.float64)))
        if s + 1 in COUNTS:
            image, mean = total / (s + 1), np.full_like(total, total.mean() / (s + 1))
            low.append(f"{low_frequency_power(image, mean):.2f}")
            filtered.append(f"{1000 * filtered_error(image, mean):.2f}")
    return low + filtered


def main() -> None:
    """Print the rows."""
    for name, sampler in methods().items():
        for title, integrand in INTEGRANDS.items():
            print("|", " | ".join([name, title, *row(sampler, integrand)]), "|", flush=True)


if __name__ == "__main__":
    main()
