"""The sum of terms as one primitive: derivatives of any kind and order, maps, closures, constant memory."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import slow, some

import qmcjax as qj
from qmcjax import samplers, scenes, sequences
from qmcjax.core import summation

N = 40


def term(parameters, k):
    a, b = parameters
    return jnp.sin(a * (k.astype(a.dtype) + 1)) * b


def total(a, b, first=0):
    state = summation.zeros(jnp.zeros(3, a.dtype))
    return summation.value(summation.add_terms(term, True, (a, b), state, jnp.uint32(first), jnp.uint32(N)))


def plain(a, b, first=0):
    return jnp.sum(jax.vmap(lambda k: term((a, b), k))(first + jnp.arange(N, dtype=jnp.uint32)), axis=0)


A, B = 0.3, np.array([1.0, 2.0, -0.5])
DERIVATIVES = {
    "jvp": lambda f: lambda a, b: jax.jvp(f, (a, b), (jnp.ones_like(a), 2 * b))[1],
    "jacfwd": lambda f: jax.jacfwd(f, argnums=(0, 1)),
    "jacrev": lambda f: jax.jacrev(f, argnums=(0, 1)),
    "hessian": lambda f: jax.hessian(f, argnums=(0, 1)),
    "gradient of gradient": lambda f: jax.jacrev(jax.jacrev(f)),
    "forward twice": lambda f: jax.jacfwd(jax.jacfwd(f, argnums=1)),
    "reverse of forward": lambda f: jax.jacrev(jax.jacfwd(f)),
    "third": lambda f: jax.grad(jax.grad(jax.grad(lambda a, b: f(a, b).sum()))),
    "linearize": lambda f: lambda a, b: jax.linearize(f, a, b)[1](jnp.ones_like(a), b),
    "vmap": lambda f: lambda a, b: jax.vmap(f, (0, None))(jnp.stack([a, 2 * a]), b),
    "vmap of gradients": lambda f: lambda a, b: jax.vmap(jax.jacrev(f), (0, None))(jnp.stack([a, 2 * a]), b),
    "vmap of both": lambda f: lambda a, b: jax.vmap(jax.jacfwd(f))(jnp.stack([a, 2 * a]), jnp.stack([b, -b])),
    "gradient of vmap": lambda f: jax.grad(lambda a, b: jax.vmap(f, (None, 0))(a, jnp.stack([b, b])).sum()),
    "checkpoint": lambda f: jax.jacrev(jax.checkpoint(f)),
}


@pytest.mark.parametrize("jit", [True, *slow(False)])
@some("derivative", DERIVATIVES, "jvp", "jacrev", "hessian", "vmap of gradients", "gradient of vmap")
def test_every_transformation_is_that_of_a_plain_sum(derivative, jit):
    with jax.enable_x64(True):
        a, b = jnp.float64(A), jnp.asarray(B)
        made, expected = derivative(total), jax.jit(derivative(plain))(a, b)
        got = (jax.jit(made) if jit else made)(a, b)
        jax.tree.map(lambda x, y: np.testing.assert_allclose(x, y, rtol=1e-11, atol=1e-11), got, expected)


def test_first_numbers_may_be_mapped():
    first = jnp.arange(3, dtype=jnp.uint32)
    mapped = jax.vmap(lambda k: total(jnp.float32(A), jnp.asarray(B, jnp.float32), k))(first)
    for k in range(3):
        np.testing.assert_allclose(mapped[k], plain(jnp.float32(A), jnp.float32(B), k), atol=1e-5)


def test_numbers_of_terms_may_not_be_mapped():
    state = summation.zeros(jnp.float32(0))

    def count(n):
        return summation.add_terms(lambda p, k: p, True, jnp.float32(1), state, jnp.uint32(0), n)

    with pytest.raises(ValueError, match="the number of terms must not be mapped"):
        jax.vmap(count)(jnp.arange(3, dtype=jnp.uint32))


@pytest.mark.parametrize("derivative", [jax.grad, jax.jacfwd])
def test_derivatives_flow_to_what_a_term_closes_over(derivative):
    def closed(a):
        state, numbers = summation.zeros(jnp.float32(0)), (jnp.uint32(0), jnp.uint32(3))
        made = summation.add_terms(lambda p, k: a * a * p, False, jnp.float32(2), state, *numbers)
        return summation.value(made)

    assert float(derivative(closed)(jnp.float32(5))) == 60


def test_gradients_are_compensated():
    """2**17 derivatives of 0.1 each, forward and in reverse: plain float32 sums lose four digits."""
    n = 2**17

    def tenths(a):
        state = summation.zeros(a)
        made = summation.add_terms(lambda a, k: 0.1 * a, True, a, state, jnp.uint32(0), jnp.uint32(n))
        return summation.value(made) / n

    for derivative in (jax.grad, jax.jacfwd):
        np.testing.assert_array_max_ulp(np.asarray(derivative(tenths)(jnp.float32(1))), np.float32(0.1))


# Hashes of a scrambling take long to compile, and do not change the memory.
SAMPLER = samplers.independent(sequences.sobol(2), key=0, randomize="xor")


@pytest.mark.slow
@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.grad, jax.hessian])
def test_derivatives_take_no_memory_for_samples(derivative):
    """The compiled derivatives of 64 times as many samples need no more."""

    def temporary(spp):
        brightness = lambda f: qj.render(scenes.zone_plate(f), SAMPLER, 32, 32, spp).sum()  # noqa: E731
        compiled = jax.jit(derivative(brightness)).lower(jnp.float32(40)).compile()
        return compiled.memory_analysis().temp_size_in_bytes

    assert temporary(1024) == temporary(16)
