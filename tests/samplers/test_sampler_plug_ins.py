"""Samplers of users: objects without decorators, functions, what is refused, and points outside of [0, 1)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import slow

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core.plug_ins import is_own


@pytest.mark.parametrize("kind", [np.int64, np.int32, np.uint8, int])
def test_any_integers_are_pixels_and_samples(kind):
    sampler = samplers.contiguous(orders.hilbert(8, 8), sequences.owen(sequences.sobol(3), 1), 2)
    expected = sampler(np.uint32(3), np.uint32(5), np.uint32(1))
    assert np.array_equal(sampler(kind(3), kind(5), kind(1)), expected)
    assert sampler([1, 2], 0, np.arange(2)).shape == (2, 3)


def centred(x, y, sample, dims, dtype=np.float32):
    columns = [(x + y + sample + np.uint32(j)) % np.uint32(8) for j in dims]
    return jnp.stack(columns, axis=-1).astype(dtype) / 8


class Made:
    """A sampler without a decorator, whose points are those of a function of sample and dims."""

    dims = 4

    def __init__(self, points):
        self.points_of = points

    def __call__(self, x, y, sample, dims, dtype):
        return self.points_of(x, y, sample, dims, dtype)


class WithoutType:
    """Without dtype, and without a check."""

    dims = 3

    def __call__(self, x, y, sample, dims):
        return centred(x, y, sample, dims)


class Prepared:
    """The two methods of a loop, and a check."""

    dims = 3

    def prepare(self, x, y, dims):
        return {"sum": x + y}

    def points(self, state, sample, dims, dtype):
        return centred(state["sum"], np.uint32(0), sample, dims, dtype)

    def check(self, width, height, spp):
        if spp > 4:
            raise ValueError(f"spp must be at most 4, got {spp}")


OWN = {"call": WithoutType(), "dtype": Made(centred), "methods": Prepared()}
OWN["function"] = samplers.function(lambda x, y, s: centred(x, y, s, (0, 1, 2)), 3)
SCENE = scenes.checkerboard()


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("dtype", [jnp.float32, *slow(jnp.float64)])
def test_any_object_with_the_protocol_is_a_sampler(name, dtype):
    sampler = samplers.as_sampler("sampler", OWN[name])
    x, y, sample = (np.arange(6, dtype=np.uint32) * np.uint32(k) for k in (1, 2, 3))
    expected = (x + y + sample)[:, None] + np.array([2, 0])
    with jax.enable_x64(True):
        for call in (sampler, jax.jit(sampler, static_argnames=("dims", "dtype"))):
            points = call(x, y, sample, dims=(2, 0), dtype=dtype)
            assert points.dtype == dtype
            assert np.array_equal(points, expected % 8 / 8)
    plain = samplers.function(lambda x, y, s: centred(x, y, s, (0, 1)), 2)
    assert np.array_equal(qj.render(SCENE, OWN[name], 4, 4, 4), qj.render(SCENE, plain, 4, 4, 4))


def test_the_check_of_a_user_is_asked():
    with pytest.raises(ValueError, match="spp must be at most 4, got 5"):
        qj.render(SCENE, Prepared(), 4, 4, 5)


class Untyped(Made):
    def __call__(self, x, y, sample, dims):
        return self.points_of(x, y, sample, dims, jnp.float32)


WRONG = {
    r"return points of shape \(5, 2\) .* got float32 \(5, 1\)": (Untyped, lambda *a: centred(*a[:3], (0,))),
    r"return floats, got an array of uint32 \(5,\)": (Untyped, lambda x, *_: x),
    "return floats, got None": (Untyped, lambda *_: None),
    r"return .* got float32 \(2,\)": (Made, lambda x, y, s, *rest: centred(x, y, s, *rest)[0]),
    r"return .* dtype float32 .* got uint32 \(5,\)": (Made, lambda x, *_: x),
}


@pytest.mark.parametrize("message", WRONG)
def test_points_of_a_user_are_checked_while_tracing(message):
    kind, points = WRONG[message]
    sampler = samplers.as_sampler("sampler", kind(points))
    with pytest.raises(ValueError, match=f"sampler must {message}"):
        jax.eval_shape(lambda x: sampler(x, 0, 0, (0, 1)), np.arange(5, dtype=np.uint32))


def test_what_is_below_one_stays_below_one():
    """A NumPy float64 that float32 would round up to 1."""
    sampler = samplers.function(lambda x, y, sample: np.full((*x.shape, 2), 1 - 2.0**-40), 2)
    assert sampler(0, 0, 0).tolist() == [1 - 2.0**-24] * 2
    assert sampler(0, 0, 0, dtype=jnp.float64).tolist() == [1 - 2.0**-40] * 2


def test_arrays_of_an_undecorated_object_are_refused():
    """A program would go on with the values of the time when it was compiled."""
    own = WithoutType()
    own.table = np.zeros(3)
    with pytest.raises(TypeError, match=r"sampler must be a pytree to have an array .* got WithoutT"):
        samplers.as_sampler("sampler", own)


def half(x, y, sample, dims, dtype):
    return jnp.full((*x.shape, len(dims)), 0.5, dtype)


def far(offset, where=lambda x, y, sample: sample == sample):
    """Return points that are somewhere off by a number."""

    def points(x, y, sample, dims, dtype):
        off = jnp.where(where(x, y, sample), jnp.asarray(offset, dtype), 0)
        return half(x, y, sample, dims, dtype) + off[..., None]

    return points


LATE = far(5, lambda x, y, sample: (x == 2) & (y == 1) & (sample == 5))
OUTSIDE = {
    "far": (far(5), r"\[5.5, 5.5\] in pixel \(0, 0\), sample 0"),
    "one": (far(0.5), r"\[1.0, 1.0\] in pixel \(0, 0\), sample 0"),
    "negative": (far(-0.75), r"\[-0.25, -0.25\] in pixel"),
    "nan": (far(np.nan), r"\[nan, nan\] in pixel"),
    "below": (lambda *where: half(*where).at[..., 1].set(-0.25), r"\[0.5, -0.25\] in pixel"),
    "late": (LATE, r"\[5.5, 5.5\] in pixel \(2, 1\), sample 5"),
}


@pytest.mark.parametrize(
    ("render", "of"),
    [*((qj.render, of) for of in OUTSIDE), *((qj.render_adaptive, of) for of in ("one", "late"))],
)
def test_points_outside_are_named(render, of):
    """What is outside is the same for all; where it is found, each render finds in its own way."""
    points, message = OUTSIDE[of]
    with pytest.raises(ValueError, match=r"sampler must return points in \[0, 1\), got " + message):
        render(scenes.zone_plate(), Made(points), 4, 4, 8)


def test_points_outside_are_not_a_number_inside_jit():
    """There nothing can be raised, and nothing looks right."""
    image = jax.jit(lambda: qj.render(scenes.zone_plate(), Made(LATE), 4, 4, 8))()
    np.testing.assert_array_equal(jnp.isnan(image), np.arange(16).reshape(4, 4) == 6)


def test_points_outside_of_colours():
    scene = scenes.function(lambda p: jnp.stack([p[..., 0]] * 3, axis=-1), ("x", "y"))
    assert qj.render(scene, Made(half), 4, 4, 2).shape == (4, 4, 3)
    with pytest.raises(ValueError, match="sampler must return points in"):
        qj.render(scene, Made(far(1)), 4, 4, 2)


def contiguous():
    return samplers.contiguous(orders.hilbert(4, 4), sequences.owen(sequences.halton(2), 1), 4)


PLUGS = [lambda: samplers.as_sampler("sampler", Made(half)), lambda: OWN["function"]]
KINDS = [(contiguous, True), (lambda: samplers.z(4, 4, 4, 1), True), *((plug, False) for plug in PLUGS)]
KIND_IDS = ["contiguous", "z", "object", "function"]


@pytest.mark.parametrize("sampler, own", KINDS, ids=KIND_IDS, indirect=["sampler"])
def test_only_what_others_made_is_checked(sampler, own):
    """Ours pay nothing: no comparison of points in the program."""
    assert is_own(sampler) == own
    scene = scenes.function(lambda p: p[..., 0], ("x", "y"))
    program = jax.jit(lambda: qj.render(scene, sampler, 4, 4, 4)).lower().as_text()
    assert ("compare  GE" in program or "compare GE" in program) != own
