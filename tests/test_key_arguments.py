"""Every public function that takes a key takes the same ones, and refuses the others in the same words."""

import inspect
import re
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import known, some
from test_fuzz import LONG, NAMES, parameters, right_call, target

pytestmark = pytest.mark.usefixtures("least_optimized")

TAKING = {
    f"{qualified}: {name}": (qualified, name)
    for qualified in NAMES
    for name in parameters(qualified)
    if name == "key"
    or re.search(rf"^{name} : .*jax\.random\.key", inspect.getdoc(target(qualified)) or "", re.M)
}
"""Parameters that are named, or documented, as a key."""

INTEGERS = ("mitsuba.render: key", "mitsuba.render_adaptive: key", "mitsuba.sensor_with: key")
INTEGERS += ("trees.two_means_tree: key",)
"""Those that are documented as an integer: of Mitsuba's properties, or of NumPy's generator."""

NEEDED = {
    "qmcjax.integrate": {"replicates": 2},
    "qmcjax.sequences.halton": {"permutation": "random"},
    "analysis.search_discrepancy": {"seconds": 60.0},
}
"""What makes a function use its key."""


def called(place, key):
    qualified, name = TAKING[place]
    result = target(qualified)(**right_call(qualified) | NEEDED.get(qualified, {}) | {name: key})
    return result._replace(seconds=0.0) if hasattr(result, "seconds") else result


def test_many_functions_take_keys():
    assert len(TAKING) > 35 and {"qmcjax.samplers.padded_replications: offsets"} < set(TAKING)


@some("place", {p: p for p in TAKING if p not in INTEGERS}, *(p for p in TAKING if TAKING[p][0] not in LONG))
def test_all_functions_take_the_same_keys(place):
    """A key of "rbg" is that of threefry with its seed, also where it was split."""
    of = [jax.random.split(jax.random.key(7, impl=impl))[1] for impl in ("threefry2x32", "rbg")]
    assert known(called(place, of[0])) == known(called(place, of[1]))


@pytest.mark.parametrize("place", TAKING)
def test_all_functions_refuse_the_same_keys(place):
    """Where a key is an integer, any other; else those of another generator, and several."""
    name = TAKING[place][1]
    if place in INTEGERS:
        with pytest.raises(TypeError, match=f"{name} must be an integer"):
            called(place, jax.random.key(7))
    else:
        with pytest.raises(
            ValueError, match=f"{name} must be a key of 'threefry2x32' or 'rbg', got one of 'own'"
        ):
            called(place, jax.random.wrap_key_data(np.zeros(3, np.uint32), impl=own_generator()))


@cache
def own_generator():
    """Return a generator that JAX does not know."""
    from jax.extend.random import define_prng_impl

    def zeros(*shape):
        return jnp.zeros(shape, jnp.uint32)

    return define_prng_impl(
        key_shape=(3,),
        seed=lambda seed: zeros(3),
        split=lambda key, shape: zeros(*shape, 3),
        random_bits=lambda key, width, shape: zeros(*shape),
        fold_in=lambda key, data: key,
        name="own",
        tag="own",
    )
