"""What all renderers take: progress outside of programs, numbers of any kind."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SCENE, SOBOL = scenes.disc(), sequences.sobol(2)
SAMPLER = samplers.contiguous(orders.hilbert(4, 4), SOBOL, 4)
PASSES = samplers.randomized(lambda key: samplers.independent(SOBOL, key), 1, 4)

FUNCTIONS = {
    "render": (qj.render, {"scene": SCENE, "sampler": SAMPLER, "width": 4, "height": 4, "spp": 4}),
    "render_adaptive": (
        qj.render_adaptive,
        {"scene": SCENE, "sampler": PASSES, "width": 4, "height": 4, "spp": 16, "tolerance": 0.5},
    ),
}


@pytest.mark.parametrize("name", ["render", "render_adaptive"])
def test_progress_must_be_a_function_outside_of_jit(name):
    function, arguments = FUNCTIONS[name]
    with pytest.raises(TypeError, match="progress must be a function of the finished part, got 3"):
        function(**arguments, progress=3)
    call = partial(function, **arguments, progress=print)
    with pytest.raises(TypeError, match=r"jax\.jit"):
        jax.jit(lambda: call())()


def test_numbers_of_any_kind_are_taken():
    image = qj.render(SCENE, SAMPLER, np.int64(4), np.uint8(4), jnp.uint32(4), dtype="float32")
    np.testing.assert_array_equal(image, qj.render(SCENE, SAMPLER, 4, 4, 4))
