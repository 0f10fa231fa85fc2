"""The four samplers that the Z paper compares on rendered scenes, and what these are for."""

from figures.shared.rendered import padded_samplers, published_keys
from qmcjax import samplers, sequences

KEY, SPP = 5, 4

EFFECTS = {
    "sports": "motion blur",
    "defocus": "depth of field",
    "interior": "paths",
    "caustic": "bidirectional paths",
}
"""What the scenes of Fig. 10 and 11 are for."""


def constituents(needs: tuple[str, ...]) -> tuple[int, ...]:
    """Return the sizes of what belongs together: x and y, and all u and v; other coordinates are single."""
    sizes = []
    for name in needs:
        if name == "y" or name.endswith("_v"):
            sizes[-1] = 2
        else:
            sizes.append(1)
    return tuple(sizes)


def make_samplers(
    needs: tuple[str, ...], side: int, spp: int = SPP, key: int = KEY
) -> dict[str, samplers.Sampler]:
    """Return the samplers for a square image of a scene with these coordinates.

    They are the paper's four, with our ranked keys for those of Heitz et al., and these if they are there.
    """
    sizes, bits = constituents(needs), spp.bit_length() - 1
    made = {
        "(0,2)-sequence": padded_samplers.zero_two(sizes, key, key + 1, bits),
        "Sobol'": samplers.full_screen(sequences.sobol(len(needs)), side, side),
        "ranked keys": padded_samplers.ranked_in_orders(sizes, key, key + 1, bits),
        "Z": samplers.z(side, side, spp, key, constituents=sizes),
    }
    return made | published_keys.beside(len(needs), key)
