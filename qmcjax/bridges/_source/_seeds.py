"""Seeds for source code that is there: another key needs no other program."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qmcjax.bridges._source._nouns import Seeded, noun
from qmcjax.core import checks
from qmcjax.samplers import Sampler


def padding_words(known: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the seeds of pairs beyond the sampler's: other words of the sampler's own."""
    return np.random.SeedSequence([2, *known.tolist()]).generate_state(2).astype(np.uint32)


def seed_words(value: Any, seeded: Seeded) -> NDArray[np.uint32]:
    """Return all words that functions of an object take as seeds."""
    words = seeded.words()
    return np.concatenate([words, padding_words(words)]) if isinstance(value, Sampler) else words


def seeds(sampler: Any, other: Any) -> NDArray[np.uint32]:
    """Return the seeds with which the source code of one object computes another.

    A shader with the function of one key renders with any key: pass these words instead of its own.

    Parameters
    ----------
    sampler, other : Sampler, Sequence, Order or Scene, or object with the methods of one
        ``sampler`` is that of the source code; ``other`` differs in its seeds only, as with another key.

    Returns
    -------
    uint32 array, shape (n,)
        The argument ``seeds`` of all functions of ``source(sampler)``.

    Raises
    ------
    TypeError
        If one is neither a sampler, a sequence, an order nor a scene.
    ValueError
        If ``other`` needs another program.

    Examples
    --------
    >>> from qmcjax import samplers, sequences
    >>> made = [samplers.independent(sequences.sobol(2), key) for key in (1, 2)]
    >>> print(seeds(made[0], made[1]).shape)
    (6,)
    """
    one, value = noun("sampler", sampler), noun("other", other)
    known, seeded = Seeded.of(one), Seeded.of(value)
    same = known.tree == seeded.tree and known.places == seeded.places
    if not same or known.constants != seeded.constants:
        raise ValueError(f"other must differ from sampler in its seeds only, got {checks.shown(other)}")
    words = seed_words(value, seeded)
    if words.size != seed_words(one, known).size:
        raise ValueError(f"other must have as many seeds as sampler, got {checks.shown(other)}")
    return words
