"""Objects as pytrees: classes with equal choices are still different structures."""

from functools import partial
from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import NETS, ORDERS, SAMPLERS, SEQUENCES, Table, each

from qmcjax import sequences

OBJECTS = SEQUENCES | SAMPLERS | Table({name: partial(make, 8, 8) for name, make in ORDERS.items()})


@pytest.mark.parametrize("makers, sizes", [(NETS, (12,)), (ORDERS, (8, 8))], ids=["nets", "orders"])
def test_classes_with_equal_fields_have_different_structures(makers, sizes):
    """Equal structures would share compiled programs, if only now and then: whenever their hashes collide."""
    for a, b in combinations([make(*sizes) for make in makers.values()], 2):
        assert jax.tree.structure(a) != jax.tree.structure(b)


@each("value", OBJECTS)
def test_flattening_and_back_keeps_class_and_fields(value):
    leaves, structure = jax.tree.flatten(value)
    again = structure.unflatten(leaves)
    assert type(again) is type(value)
    assert jax.tree.structure(again) == structure
    assert all(a is b for a, b in zip(leaves, jax.tree.leaves(again), strict=True))


def test_leaves_have_the_names_of_their_fields():
    paths = [
        jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(sequences.uniform(2, 0))
    ]
    assert paths == [".seeds"]


def test_leaves_may_be_traced_and_mapped():
    seq = sequences.uniform(1, key=0)
    stacked = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf + np.uint32(1)]), seq)
    points = jax.vmap(lambda s: s(jnp.uint32(3)))(stacked)
    assert points.shape == (2, 1)
    assert points[0] == seq(3)
