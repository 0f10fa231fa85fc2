"""Derivatives of what renders, by every transformation, and the project's own rules of derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import some

import analysis
import qmcjax as qj
from analysis._design.integrands import Rendered, blur
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import devices
from qmcjax.core.parameters import moves_an_edge

# Programs of few points.
jit = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
SIDE, SPP = 4, 8
SAMPLER = samplers.contiguous(orders.raster(SIDE, SIDE), sequences.roberts(2), SPP)
POINTS = np.random.default_rng(1).uniform(0.1, 0.8, (SIDE, SIDE, 2, 2))
STEPS = np.random.default_rng(2).uniform(-0.1, 0.1, POINTS.shape)
EYE = tracing.camera([0.1, 1.5, 1.0], [0.0, 0, 0], fov=40.0)


def image(frequency):
    return qj.render(scenes.zone_plate(frequency), SAMPLER, SIDE, SIDE, SPP, dtype=jnp.float64)


def mean(difficulty):
    scene = scenes.genz("oscillatory", 2, difficulty, 0.2)
    return qj.integrate(scene, sequences.sobol(2), 2**15 + 5, dtype=jnp.float64)


def error_of_points(part):
    """Return the filtered error of an image, as its points move."""
    points = jnp.asarray(POINTS) + part * STEPS
    sampler = samplers.function(lambda x, y, sample: points[y, x, sample], 2)
    made = qj.render(scenes.gaussian(), sampler, SIDE, SIDE, 2, dtype=jnp.float64)
    return analysis.filtered_error(made, np.zeros((SIDE, SIDE)))


def traced(make):
    """Return the brightness of a floor under two lights: derivatives of directions are right in mean only."""

    def brightness(color):
        floor = tracing.plane([0, 0, 0], [0, 1, 0], material=tracing.diffuse(color))
        lights = [tracing.point_light([0.3, 1.5, -0.2], 1.0 + color**2), tracing.environment(color)]
        scene = make(tracing.world([floor], lights), EYE)
        sampler = samplers.independent(sequences.roberts(len(scene.needs)), key=0)
        return qj.render(scene, sampler, 2, 2, 2, dtype=jnp.float64).mean()

    return brightness


OF_ONE = {
    "pixel": (lambda f: image(f)[2, 1], 12.0),
    "image": (lambda f: (image(f) ** 2).mean(), 12.0),
    "integrate": (mean, 3.0),
    "filtered_error of points": (error_of_points, 0.1),
    "direct_light": (traced(tracing.direct_light), 0.4),
    "path_tracing": (traced(lambda *given, **how: tracing.path_tracing(*given, bounces=1, **how)), 0.4),
}
"""A function of one number, and a place."""


@some("case", OF_ONE, "pixel")
def test_every_transformation_is_the_difference(case):
    """One program of all: compiling takes longest. Values are those without derivatives."""
    function, at = case

    def every(x):
        value, slope = jax.value_and_grad(function)(x)
        (ahead, along), linear = jax.jvp(function, (x,), (x,)), jax.linearize(function, x)
        return {
            "value": (value, ahead, linear[0]),
            "slope": (slope, along / x, linear[1](jnp.ones(()))),
            "bend": jax.hessian(function)(x),
            "mapped": jax.vmap(jax.grad(function))(jnp.stack([x, 1.1 * x])),
        }

    with jax.enable_x64(True):
        x, h = jnp.float64(at), 1e-5
        made, plain, gradient = jit(every)(x), jit(function), jit(jax.grad(function))
        slope = (plain(x + h) - plain(x - h)) / (2 * h)
        np.testing.assert_allclose(made["value"], [plain(x)] * 3, rtol=1e-13)
        np.testing.assert_allclose(made["slope"], [slope] * 3, rtol=1e-6)
        np.testing.assert_allclose(made["slope"], [gradient(x)] * 3, rtol=1e-11)
        np.testing.assert_allclose(made["bend"], (gradient(x + h) - gradient(x - h)) / (2 * h), rtol=1e-6)
        np.testing.assert_allclose(made["mapped"], [gradient(x), gradient(1.1 * x)], rtol=1e-11)


CLOUD = np.random.default_rng(3).uniform(0.05, 0.95, (9, 2))


def of_parts(make):
    """Return a sum over parts of a function that shares a number."""
    numbers = np.arange(1.0, 20.0)
    return lambda x: (make(lambda part, x: jnp.sin(part * x) * x, numbers, x) ** 2).sum()


def refused(x):
    return moves_an_edge("Disc.radius", x) * x


def of_blurred(points):
    """Return the sum of a linear function."""
    made = Rendered(lambda points: 3 * points[..., :1] - points[..., 1:], np.zeros((1, 1, 1, 1)))
    return blur(made, jax.random.key(5), jnp.float64(1e-3)).values(points[None, None, None]).sum()


CASES = {
    "differentiable": (of_parts(lambda f, *given: devices.differentiable(f, None, *given)), 0.3),
    "summed": (of_parts(lambda f, *given: devices.summed(f, None, True, *given)), 0.3),
    "edge": (refused, 0.3),
    "min_distance": (analysis.min_distance, CLOUD),
    "expected_error": (analysis.expected_error, POINTS[:2, :3]),
    "blurred": (of_blurred, CLOUD),
    "riesz_energy": (analysis.riesz_energy, CLOUD),
    "l2_star": (analysis.l2_star_discrepancy, CLOUD),
    "point_spectrum": (lambda points: analysis.point_spectrum(points, 5)[0, 1], CLOUD),
}
"""Each derivative that the project defines itself: a function of an array that calls it, and a place."""
FORWARD = ("differentiable", "summed", "min_distance", "expected_error")


def depends(program, moved):
    """Return which results depend on which operands, by operations: their results on all they are given."""
    known = dict(zip(program.invars, moved, strict=True))

    def of(variables):  # Literals have a value.
        return [not hasattr(each, "val") and known.get(each, False) for each in variables]

    for equation in program.eqns:
        given, inner = of(equation.invars), equation.params.get("jaxpr")
        call = equation.primitive.name in ("jit", "pjit")
        made = depends(inner.jaxpr, given) if call else [any(given)] * len(equation.outvars)
        known |= zip(equation.outvars, made, strict=True)
    return of(program.outvars)


def forward(function, x):
    return jax.jvp(function, (x,), (jnp.ones_like(x),))


def linearized(function, x):
    value, linear = jax.linearize(function, x)
    return value, linear(jnp.ones_like(x))


def mapped(function, x):
    return jax.vmap(jax.grad(function))(jnp.stack([x, x]))


@pytest.mark.parametrize("transformed", [forward, linearized, mapped, lambda f, x: jax.hessian(f)(x)])
def test_edges_refuse_every_transformation(transformed):
    function, at = CASES["edge"]
    with pytest.raises(ValueError, match=r"Disc\.radius moves an edge"):
        transformed(function, jnp.float32(at))


@pytest.mark.parametrize("name", sorted(CASES.keys() - {"edge"}))
def test_rules_give_derivatives_and_values_that_do_not_depend_on_tangents(name):
    """Against differences; JAX from 0.12 on refuses values that are computed together with tangents."""
    function, at = CASES[name]
    forward_too, twice = name in FORWARD, name != "min_distance"

    def every(x, step):
        slope = jax.grad(function)(x)
        made = {"slope": [slope], "mapped": mapped(function, x)}
        if forward_too:
            value, along = jax.jvp(function, (x,), (step,))
            made |= {"values": [value, linearized(function, x)[0]], "along": along}
        if twice:
            made["bend"] = jnp.tensordot(jax.hessian(function)(x), step, x.ndim)
        return made

    with jax.enable_x64(True):
        x = jnp.asarray(at, jnp.float64)
        step = jnp.asarray(np.random.default_rng(4).normal(size=x.shape))
        made, value, gradient = jit(every)(x, step), jit(function), jit(jax.grad(function))
        slope = gradient(x)
        np.testing.assert_allclose(made["mapped"], [slope, slope], rtol=1e-12)
        if name != "blurred":  # Its derivative is that of a blur of its values: test_expected_error.py.
            difference = (value(x + 1e-6 * step) - value(x - 1e-6 * step)) / 2e-6
            np.testing.assert_allclose(np.sum(slope * step), difference, rtol=1e-6)
        if forward_too:
            np.testing.assert_allclose(made["along"], np.sum(slope * step), rtol=1e-12)
            np.testing.assert_allclose(made["values"], value(x), rtol=1e-14)
            program = jax.make_jaxpr(lambda x, step: jax.jvp(function, (x,), (step,)))(x, step)
            assert depends(program.jaxpr, [False, True]) == [False, True]
        if twice:
            difference = (gradient(x + 1e-6 * step) - gradient(x - 1e-6 * step)) / 2e-6
            np.testing.assert_allclose(made["bend"], difference, rtol=1e-5, atol=1e-5 * np.abs(slope).max())
