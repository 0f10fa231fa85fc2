"""What is traced once: operations in the program of the caller, NumPy without a program."""

import jax
import jax.numpy as jnp
import numpy as np

from qmcjax.core.bits import traced_once


def test_a_function_is_traced_once_and_taken_over():
    """Its operations are those of the program that calls it; NumPy's arrays need no program."""
    traces = []

    @traced_once
    def twice(word):
        traces.append(type(word))
        return word + word

    words = np.arange(4, dtype=np.uint32)
    assert isinstance(twice(words), np.ndarray) and traces == [np.ndarray]
    made = jax.jit(lambda word: twice(twice(word))).lower(words).as_text()
    assert made.count("stablehlo.add") == 2 and "call" not in made and len(traces) == 2
    np.testing.assert_array_equal(jax.vmap(twice)(jnp.stack([words, words])), [2 * words] * 2)
    np.testing.assert_array_equal(twice(jnp.asarray(words)), 2 * words)
    assert len(traces) == 2
    twice(jnp.asarray(words[:3]))
    assert len(traces) == 3
