"""Points of users' samplers: their shape while tracing, their range like the values' finiteness."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core.plug_ins import is_own


class Made:
    """A sampler without a decorator, whose points are those of a function of sample and dims."""

    dims = 4

    def __init__(self, points):
        self.points_of = points

    def __call__(self, x, y, sample, dims, dtype):
        return self.points_of(x, y, sample, dims, dtype)


def half(x, y, sample, dims, dtype):
    return jnp.full((*x.shape, len(dims)), 0.5, dtype)


def far(offset, where=lambda x, y, sample: sample == sample):
    """Return points that are somewhere off by a number."""

    def points(x, y, sample, dims, dtype):
        off = jnp.where(where(x, y, sample), jnp.asarray(offset, dtype), 0)
        return half(x, y, sample, dims, dtype) + off[..., None]

    return points


def below(x, y, sample, dims, dtype):
    return half(x, y, sample, dims, dtype).at[..., 1].set(-0.25)


LATE = far(5, lambda x, y, sample: (x == 2) & (y == 1) & (sample == 5))
RENDERS = {"render": qj.render, "adaptive": qj.render_adaptive}


OUTSIDE = {
    "far": (far(5), r"\[5.5, 5.5\] in pixel \(0, 0\), sample 0"),
    "one": (far(0.5), r"\[1.0, 1.0\] in pixel \(0, 0\), sample 0"),
    "negative": (far(-0.75), r"\[-0.25, -0.25\] in pixel"),
    "nan": (far(np.nan), r"\[nan, nan\] in pixel"),
    "below": (below, r"\[0.5, -0.25\] in pixel"),
    "late": (LATE, r"\[5.5, 5.5\] in pixel \(2, 1\), sample 5"),
}


@pytest.mark.parametrize(
    ("name", "of"), [*(("render", of) for of in OUTSIDE), *(("adaptive", of) for of in ("one", "late"))]
)
def test_points_outside_are_named(name, of):
    """What is outside is the same for all; where it is found, each render finds in its own way."""
    render, (points, message) = RENDERS[name], OUTSIDE[of]
    with pytest.raises(ValueError, match=r"sampler must return points in \[0, 1\), got " + message):
        render(scenes.zone_plate(), Made(points), 4, 4, 8)


def test_what_is_below_one_stays_below_one():
    """A NumPy float64 that float32 would round up to 1."""
    sampler = samplers.function(lambda x, y, sample: np.full((*x.shape, 2), 1 - 2.0**-40), 2)
    assert sampler(0, 0, 0).tolist() == [1 - 2.0**-24] * 2
    assert sampler(0, 0, 0, dtype=jnp.float64).tolist() == [1 - 2.0**-40] * 2


def test_points_outside_are_not_a_number_inside_jit():
    """There nothing can be raised, and nothing looks right."""
    image = jax.jit(lambda: qj.render(scenes.zone_plate(), Made(LATE), 4, 4, 8))()
    np.testing.assert_array_equal(jnp.isnan(image), np.arange(16).reshape(4, 4) == 6)


def test_points_outside_of_colours():
    scene = scenes.function(lambda p: jnp.stack([p[..., 0]] * 3, axis=-1), ("x", "y"))
    assert qj.render(scene, Made(half), 4, 4, 2).shape == (4, 4, 3)
    with pytest.raises(ValueError, match="sampler must return points in"):
        qj.render(scene, Made(far(1)), 4, 4, 2)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            lambda x, y, s, dims, dtype: half(x, y, s, (0,), dtype),
            r"shape \(16, 2\) .* got float32 \(16, 1\)",
        ),
        (lambda x, y, s, dims, dtype: half(x, y, s, dims, jnp.int32), "float"),
        (lambda x, y, s, dims, dtype: None, "got None"),
    ],
    ids=["last axis", "integers", "none"],
)
def test_shapes_and_types_are_checked_while_tracing(points, message):
    with pytest.raises((TypeError, ValueError), match=message):
        jax.eval_shape(lambda: qj.render(scenes.zone_plate(), Made(points), 4, 4, 2))


@pytest.mark.parametrize(
    ("sampler", "own"),
    [
        (lambda: samplers.contiguous(orders.hilbert(4, 4), sequences.owen(sequences.halton(2), 1), 4), True),
        (lambda: samplers.z(4, 4, 4, 1), True),
        (lambda: samplers.as_sampler("sampler", Made(half)), False),
        (lambda: samplers.function(lambda x, y, sample: half(x, y, sample, (0, 1), jnp.float32), 2), False),
    ],
    ids=["contiguous", "z", "object", "function"],
    indirect=["sampler"],
)
def test_only_what_others_made_is_checked(sampler, own):
    """Ours pay nothing: no comparison of points in the program."""
    assert is_own(sampler) == own
    scene = scenes.function(lambda p: p[..., 0], ("x", "y"))
    program = jax.jit(lambda: qj.render(scene, sampler, 4, 4, 4)).lower().as_text()
    assert ("compare  GE" in program or "compare GE" in program) != own
