"""Objects as pytrees: classes with equal choices are still different structures."""

from dataclasses import dataclass
from functools import partial
from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import BY_DEFAULT, NETS, ORDERS, SAMPLERS, SEQUENCES, Table, some

from qmcjax import pytree, sequences
from qmcjax.core.pytrees import is_traced

CURVES = Table({f"order, {name}": partial(make, 8, 8) for name, make in ORDERS.items()})
OBJECTS = SEQUENCES | SAMPLERS | CURVES


@pytest.mark.parametrize("makers, sizes", [(NETS, (12,)), (ORDERS, (8, 8))], ids=["nets", "orders"])
def test_classes_with_equal_fields_have_different_structures(makers, sizes):
    """Equal structures would share compiled programs, if only now and then: whenever their hashes collide."""
    for a, b in combinations([make(*sizes) for make in makers.values()], 2):
        assert jax.tree.structure(a) != jax.tree.structure(b)


def test_a_class_that_is_written_anew_is_another_one():
    """As in a notebook: one name, the same fields, and a program of its own."""

    def defined(factor):
        @pytree
        @dataclass(frozen=True)
        class Scaled:
            x: jax.Array

            def __call__(self):
                return factor * self.x

        return Scaled(jnp.float32(3))

    first, second = defined(1), defined(2)
    assert jax.tree.structure(first) != jax.tree.structure(second) and first != second
    program = jax.jit(lambda scaled: scaled())
    assert (program(first), program(second)) == (3, 6)


@some("value", OBJECTS, *BY_DEFAULT["sequences"], *BY_DEFAULT["samplers"], *CURVES)
def test_every_object_is_a_tree_with_a_line_that_compares(value):
    """There and back: its class and its fields; other leaves: another object."""
    text = repr(value)
    assert "\n" not in text and "rray" not in text and len(text) < 400
    leaves, structure = jax.tree.flatten(value)
    back = structure.unflatten(leaves)
    assert type(back) is type(value) and jax.tree.structure(back) == structure
    assert all(a is b for a, b in zip(leaves, jax.tree.leaves(back), strict=True))
    keys = [jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) for leaf in leaves]
    copies = [jax.random.clone(a) if key else np.array(a) for a, key in zip(leaves, keys, strict=True)]
    again = structure.unflatten(copies)
    assert value == again and hash(value) == hash(again) and value in [again]
    assert value != 3 and value != leaves
    numbers = [k for k, key in enumerate(keys) if not key and leaves[k].size]
    if numbers:
        leaves[numbers[0]] = leaves[numbers[0]] + np.ones((), leaves[numbers[0]].dtype)
        assert value != structure.unflatten(leaves)


def test_equal_bytes_are_not_equal_arrays():
    """The dtype and the shape count, too."""
    given = [np.zeros((2, 3), "f4"), np.zeros((2, 3), "i4"), np.zeros((3, 2), "f4"), np.zeros(12, "f2")]
    found = [Shell(array) for array in given]
    assert [[a == b for b in found] for a in found] == np.eye(4, dtype=bool).tolist()


def test_equal_keys_are_equal_and_traced_values_only_themselves():
    assert sequences.owen(sequences.sobol(2), 1) == sequences.owen(sequences.sobol(2), jax.random.key(1))
    assert sequences.owen(sequences.sobol(2), 1) != sequences.owen(sequences.sobol(2), 2)
    compared = []
    jax.jit(lambda a, b: compared.extend((a == a, a == b)) or a.dims)(*[sequences.uniform(1, 0)] * 2)
    assert compared == [True, False]


@pytree
@dataclass(frozen=True, eq=False)
class Shell:
    x: np.ndarray


def test_methods_that_a_class_writes_itself_stay():
    @pytree
    @dataclass(frozen=True)
    class Own:
        x: jax.Array

        def __repr__(self):
            return "own"

        def __eq__(self, other):
            return other == 5

    assert repr(Own(jnp.zeros(2))) == "own" and Own(jnp.zeros(2)) == 5


def test_what_functions_close_over_may_be_traced():
    found = []
    jax.grad(lambda x: (found.append(is_traced((lambda: x,))), x)[1])(1.0)
    assert found == [True] and not is_traced((lambda: found,))
