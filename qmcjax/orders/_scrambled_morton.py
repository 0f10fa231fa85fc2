"""The variants of the scrambled Morton order."""

import jax.numpy as jnp
from jax import Array

from qmcjax.core import checks, draws
from qmcjax.orders._hashed import Hashed, Multiplicative
from qmcjax.orders._hierarchy import ScrambledMorton
from qmcjax.orders._lookup_tree import (
    LookupTree,
    RandomTree,
    art_production,
    random_permutations,
    random_production,
)

VARIANTS = ("hash", "multiplicative", "tree", "art")
"""Sources of permutations, see :func:`scrambled_morton`."""

ALPHABET = 4096
"""Letters of the tree in the Z paper, Sect. 4.2."""


def scrambled_morton(
    width: int, height: int, key: Array | int, variant: str = "hash", alphabet: int | None = None
) -> ScrambledMorton:
    """Make a hierarchically scrambled Morton order: the quadrants of each square in a random order.

    Every aligned square of ``2**k`` pixels per side keeps one contiguous aligned run of positions, as in the
    Morton order.

    Parameters
    ----------
    width, height : int, in [1, 65536]; the curve fills the next square with a power of two as side
    key : jax.random.key, or int in [0, 2**32)
        A new key gives a new order without recompilation. For "multiplicative" an int is the paper's
        dimension d; a key draws one.
    variant : {"hash", "multiplicative", "tree", "art"}
        Source of the permutation at each node. "hash": a hash of the node and the key, with three products
        per level. "multiplicative": the product with the golden ratio of the paper. "tree": the letter of the
        node in a random grammar. "art": the same for a grammar of 4096 letters with equal letters far apart.
    alphabet : int, optional
        For "tree" only: the number of letters, in [1, 65536], by default 4096.

    Notes
    -----
    Over the keys all 24 permutations of each node are equally likely. "multiplicative" lacks independence:
    over the nodes of a level all permutations are equally frequent, but the permutation of a node leaves two
    choices for its sibling. Prefixes are numbers, so leading zeros do not count: on the path to pixel (0, 0)
    all permutations equal that of the root. The golden ratio is truncated to 32 bits, and the numbering of
    the 24 permutations is ours: the paper gives none.

    References
    ----------
    .. [1] A. Ahmed, P. Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
       Hierarchical Ordering of Pixels", 2020, Sect. 3.2 (Eq. 5), 4.1 (Eq. 8), 4.2 and 4.4 (Eq. 13 to 18;
       Eq. 18 stands for alpha <- psi[alpha][z_j]), 5.7 (ART).

    Examples
    --------
    >>> order = scrambled_morton(4, 4, key=1)
    >>> print(sorted(int(order.position(x, y)) // 4 for x in (0, 1) for y in (2, 3)))
    [3, 3, 3, 3]
    """
    width, height = checks.image_size(width, height)
    checks.choice("variant", variant, VARIANTS)
    if alphabet is not None and variant != "tree":
        raise ValueError(f"alphabet must be given for variant='tree' only, got {alphabet!r}")
    random = checks.prng_key("key", key)
    if variant == "hash":
        return Hashed(width, height, draws.bits(random, (), jnp.uint32))
    if variant == "multiplicative":
        dim = jnp.uint32(key) if isinstance(key, int) else draws.bits(random, (), jnp.uint32)
        return Multiplicative(width, height, dim)
    of_production, of_permutations = draws.split(random)
    if variant == "art":
        production = art_production()
        return LookupTree(width, height, production, random_permutations(len(production), of_permutations))
    letters = checks.integer("alphabet", ALPHABET if alphabet is None else alphabet, 1, 2**16)
    production = random_production(letters, of_production)
    return RandomTree(width, height, production, random_permutations(letters, of_permutations), jnp.uint32(0))
