"""The exact scenes as functions of points: their definitions, where they vary, and their parameters."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import EVERY, MOTION, PERSPECTIVE, PLANE, defined, evaluated, mixed, varied
from tables import each, few, some

from qmcjax import scenes

ONCE = ["step", "staircase", "line", "disc", "triangle", "flat board", "heaviside(3)"]
"""One of each kind."""
MOVING = ["moving_edge", "blinking_disc", "ball", "defocused_edge", "soft_shadow"]
NEEDS = {kind: ("time",) for kind in (scenes.MovingEdge, scenes.BlinkingDisc, scenes.Ball)}
NEEDS |= {scenes.DefocusedEdge: ("lens_u", "lens_v"), scenes.SoftShadow: ("light_u", "light_v")}


@jax.jit
def on_edges(scene, u):
    return scene.boundary(u)[0]


@pytest.mark.parametrize("name", few(EVERY, *(n for n in EVERY if n not in PLANE or n in ONCE)))
def test_values_follow_the_definition(name):
    """But for the few points that an edge meets by rounding, in both precisions."""
    scene = EVERY[name]
    points = np.random.default_rng(1).random((20000, len(scene.needs))) + 2.0**-30
    with jax.enable_x64(True):
        values = evaluated(scene, jnp.asarray(points))
        assert values.dtype == jnp.float64 and values.shape == (20000,)
    off = 1e-9 if name in PERSPECTIVE else 1e-12
    truth = np.asarray(defined(scene, points.T), np.float64)
    assert np.mean(abs(np.asarray(values) - truth) > off * np.maximum(1, abs(truth))) <= 1e-4
    if name in PERSPECTIVE:
        return
    points = points.astype(np.float32)
    values = evaluated(scene, points)
    assert values.dtype == jnp.float32
    truth = np.asarray(defined(scene, points.T.astype(np.float64)), np.float64)
    far = abs(np.asarray(values) - truth) > 3e-5 * np.maximum(abs(truth), 0.03 * abs(truth).max())
    assert far.mean() <= 1e-3


def test_what_does_not_change_needs_no_coordinates():
    for name, scene in MOTION.items():
        assert scene.needs == ("x", "y", *(() if "still" in name else NEEDS[type(scene)]))


def boxes(scene, count, rng):
    """Return boxes: pixels with parts of the other dimensions, of many sizes, or half of them at an edge."""
    dims = len(scene.needs)
    if type(scene) in NEEDS:
        sides = 2.0 ** -rng.integers(0, 8, (count, dims))
        sides[:, 1] = sides[:, 0]
        sides[: count // 3, 2:] = 1
        low = np.floor(rng.random(sides.shape) / sides) * sides
        return low.astype(np.float32), (low + sides).astype(np.float32)
    size = np.exp2(-rng.uniform(1, 24, (count, 1))) * rng.uniform(0.1, 1, (count, dims))
    centre = rng.random((count, dims))
    if isinstance(scene, scenes.Checkerboard):
        beside = size[::2, 1] * rng.normal(size=count // 2)
        centre[::2, 1] = float(scene.squares) / rng.integers(8, 99, count // 2) + beside
    else:
        on_edge = on_edges(scene, rng.random((count // 2, dims - 1), dtype=np.float32))
        centre[::2] = np.asarray(on_edge) + size[::2] * rng.normal(size=(count // 2, dims))
    top = 1 - 2.0**-24
    return [np.clip(c, 0, top).astype(np.float32) for c in (centre - size / 2, centre + size / 2)]


BOARDS = {"checkerboard": scenes.checkerboard(), "checkerboard, few": scenes.checkerboard(3.3)}


@some("scene", PLANE | MOTION | BOARDS, *ONCE, *MOVING, "checkerboard")
def test_varies_is_certain(scene):
    """Where it says False no change of that coordinate changes the value, at any of the points tried."""
    count, tries = 400, 200
    rng = np.random.default_rng(5)
    low, high = boxes(scene, count, rng)
    may = np.asarray(varied(scene, low, high))
    assert may.shape == low.shape and may.dtype == bool and 0.02 < may.mean() < 0.98
    unit = rng.random((2, count, tries, low.shape[1]), dtype=np.float32)
    unit[:, :, ::3] = np.round(unit[:, :, ::3])  # corners and edges, too
    first, second = np.clip(low[:, None] + unit * (high - low)[:, None], low[:, None], high[:, None])
    before = np.asarray(evaluated(scene, first))
    for j in range(low.shape[1]):
        changed = first.copy()
        changed[..., j] = second[..., j]
        differs = np.any(np.asarray(evaluated(scene, changed)) != before, axis=1)
        assert not np.any(differs & ~may[:, j])
    constant = ~may.any(axis=1)
    assert np.all(before[constant] == before[constant][:, :1])
    assert constant.mean() >= (0.25 if type(scene) in NEEDS else 0.02)


def pixels(scene, side):
    """Return opposite corners of all pixels, with all of the other dimensions."""
    y, x = np.indices((side, side)).astype(np.float32) / np.float32(side)
    rest = [np.zeros_like(x)] * (len(scene.needs) - 2)
    low = np.stack([x, y, *rest], axis=-1)
    return low, low + np.asarray([1 / side] * 2 + [1] * len(rest), np.float32)


@pytest.mark.parametrize("name", [*ONCE[:-1], *MOTION, "checkerboard"])
def test_varies_is_not_wasteful(name):
    """Pixels vary that hold an edge, and few others.

    Up to 10 beyond each sharp corner, and those an edge just touches; 0.5 % of the image, where it moves; on
    the checkerboard both sides of borders that are borders of pixels, x = 1/2, and y = 1, 1/2, 1/4, ...
    """
    scene, side = (EVERY | BOARDS)[name], 128 if name in MOTION else 256
    found = np.asarray(varied(scene, *pixels(scene, side))).any(axis=-1)
    held = mixed(scene, *scene.reference(side, side))
    assert not np.any(held & ~found)
    most = {"checkerboard": 2 * side * 10}.get(name, 0.005 * side**2 if name in MOTION else 30)
    assert found.sum() - held.sum() <= most


def test_the_horizon_does_not_vary():
    """There all is 1/2."""
    far = np.array([[0.3, 0.0]], np.float32), np.array([[0.3001, 1e-7]], np.float32)
    assert not np.any(varied(scenes.checkerboard(), *far))


def test_varies_tells_the_coordinates_apart():
    """Time only where something moves in the box, the position only where an edge is in it."""
    low, high = jnp.asarray([[[0.4, 0.4, 0.0], [0.4, 0.4, 0.3]], [[0.5, 0.5, 0.2], [0.5, 0.5, 0.7]]])
    disc = scenes.blinking_disc((0.45, 0.45), 0.3, (0.25, 0.75))
    assert not np.any(varied(disc, low, high))
    assert np.array_equal(varied(disc, low[:1], high[1:]), [[False, False, True]])
    edge = scenes.moving_edge(0.45, 0.0)
    assert np.array_equal(varied(edge, low[:1], high[:1]), [[True, False, False]])
    # A ball that rests, jumps away and is back: here only time matters, and only over a jump.
    ball = scenes.ball([[0.45, 0.45], [3.0, 3.0], [0.45, 0.45]], None, [0.25, 0.5], 0.3)
    for first, last, expected in ((0.0, 0.2, False), (0.2, 0.3, True), (0.3, 0.4, False), (0.6, 0.9, False)):
        ends = low[:1].at[0, 2].set(first), high[:1].at[0, 2].set(last)
        assert np.array_equal(varied(ball, *ends), [[False, False, expected]])
    still = scenes.ball([[0.45, 0.45]], [[0.45, 0.45]], (), 0.03)
    assert np.array_equal(varied(still, low[:1], high[:1]), [[True, True, False]])
    lens = scenes.defocused_edge(0.0, 0.5, 0.1, "square")
    box = jnp.asarray([[0.45, 0.1, 0.0, 0.0]]), jnp.asarray([[0.46, 0.2, 1.0, 1.0]])
    assert np.array_equal(varied(lens, *box), [[True, False, True, False]])


@pytest.mark.parametrize("name", few(PLANE, "step", "disc", "triangle", "heaviside(3)"))
def test_float32_misses_only_what_may_vary(name):
    """On and beside the edges, where float32 and float64 disagree the point as a box may vary."""
    scene = PLANE[name]
    scene = jax.tree.map(lambda leaf: np.asarray(leaf, np.float32), scene)
    rng = np.random.default_rng(13)
    u = rng.random((20000, len(scene.needs) - 1), dtype=np.float32)
    on_edge = np.asarray(on_edges(scene, u))
    points = on_edge + np.float32(1e-7) * rng.normal(size=on_edge.shape).astype(np.float32)
    points = np.clip(points, 0, 1 - np.float32(2**-24))
    single = np.asarray(evaluated(scene, points), np.float64)
    differ = abs(single - defined(jax.tree.map(np.float64, scene), points.T.astype(np.float64))) > 1e-6
    assert np.all(np.asarray(varied(scene, points, points))[differ])


def random_points(n, seed=1):
    return np.random.default_rng(seed).integers(0, 2**24, (n, 2)).astype(np.float32) * np.float32(2**-24)


@each("scene", PERSPECTIVE)
def test_float32_misses_only_what_rounding_explains(scene):
    """float32 and float64 differ by the rounded phase, or on squares whose border is within the rounding."""
    points = random_points(100000)
    points[:, 1] += np.float32(2**-24)
    single = np.asarray(scene(jnp.asarray(points)), dtype=np.float64)
    x, y = points.astype(np.float64).T
    difference = abs(single - defined(scene, np.stack([x, y])))
    if isinstance(scene, scenes.ZonePlate):
        assert np.all(difference <= 4 * 2.0**-24 * (1 + scene.frequency * (x * x + y * y)))
        return
    depth = scene.squares / y
    slack = 3 * 2.0**-24 * depth
    near = [abs(v - np.rint(v)) <= slack for v in (depth, (x - 0.5) * depth)]
    assert not np.any((difference > 0) & ~near[0] & ~near[1])
    # At a given depth a share of 4 slack is near a border; averaged over y this has a logarithm.
    typical = 2.0**-24 * scene.squares
    assert np.mean(difference > 0) <= 20 * typical * np.log(1 / typical)


@each("scene", PERSPECTIVE)
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_corners_and_horizon_are_finite(scene, dtype):
    """Values stay in [0, 1] down to the smallest numbers, at x = 1/2 and on the horizon itself."""
    with jax.enable_x64(True), jax.debug_nans(True), jax.debug_infs(False):
        tiny = float(jnp.finfo(dtype).tiny)
        below = 1 - float(jnp.finfo(dtype).epsneg)
        ends = np.array([0, tiny, 1e-30, 1e-8, 2**-20, 0.25, 0.5, below], dtype)
        points = jnp.asarray(np.stack(np.meshgrid(ends, ends), axis=-1))
        values = scene(points)
        assert values.dtype == dtype and values.shape == points.shape[:-1]
        values = np.asarray(values)
        assert np.all((values >= 0) & (values <= 1))


def test_horizon_is_the_mean():
    """Where squares cannot be told apart the value is 1/2, and just below it is not."""
    y = jnp.array([0, 2**-30, 2**-19, 2**-18.9, 2**-10], dtype=jnp.float32)
    values = scenes.checkerboard(8.0)(jnp.stack([jnp.full_like(y, 0.3), y], axis=-1))
    assert np.array_equal(values == 0.5, [True, True, True, False, False])


MAKERS = {
    "moving_edge": lambda v: scenes.moving_edge(v[0], v[1]),
    "blinking_disc": lambda v: scenes.blinking_disc(v[:2], v[2], v[2:]),
    "ball": lambda v: scenes.ball(v.reshape(2, 2), 0.5 * v.reshape(2, 2), v[:1], v[1]),
    "defocused_edge": lambda v: scenes.defocused_edge(v[0], v[1], v[2]),
    "soft_shadow": lambda v: scenes.soft_shadow(v[0], v[1], v[2], v[2:]),
    "step": lambda v: scenes.step(v[0], v[1]),
    "staircase": lambda v: scenes.staircase(v[0], v[1:]),
    "line": lambda v: scenes.line(v[0], v[1], 0.1 * v[2]),
    "triangle": lambda v: scenes.triangle([[v[0], v[1]], [v[2], 0.1], [0.1, v[3]]]),
    "flat_checkerboard": lambda v: scenes.flat_checkerboard(9 * v[0], v[1]),
    "heaviside": lambda v: scenes.heaviside(3, v[0]),
    "disc": lambda v: scenes.disc(v[:2], v[2]),
    "checkerboard": lambda v: scenes.checkerboard(9 * v[0]),
    "discontinuous": lambda v: scenes.genz("discontinuous", 2, v[:2], v[2]),
    "zone_plate": lambda v: scenes.zone_plate(v[0]),
    "gaussian": lambda v: scenes.gaussian((v[0], 0.5), v[2]),
    "product": lambda v: scenes.product(v[:2]),
    "genz": lambda v: scenes.genz("product_peak", 2, v[2], v[:2]),
    "path_toy": lambda v: scenes.path_toy(1, v[0], v[1], v[2]),
}


@each("make", MAKERS)
def test_vmap_over_parameters_is_a_loop(make):
    """A new parameter is a new leaf, not a new program."""
    parameters = np.array([[0.3, 0.6, 0.5, 0.9], [0.2, 0.5, 0.4, 0.5]], np.float32)
    points = np.random.default_rng(2).random((200, len(make(parameters[0]).needs)), np.float32)
    count = evaluated._cache_size()
    looped = np.stack([evaluated(make(v), points) for v in parameters])
    assert evaluated._cache_size() == count + 1 and not np.array_equal(*looped)
    mapped = jax.jit(jax.vmap(lambda v: make(v)(points)))(parameters)
    share = 0.005 if hasattr(make(parameters[0]), "varies") else 0
    assert np.mean(abs(mapped - looped) > 2e-5 * abs(looped)) <= share


@pytest.mark.parametrize("name", few([*ONCE, "checkerboard", *MOVING], "step", "heaviside(3)", "ball"))
def test_the_plain_derivative_is_refused(name):
    """Forward and in reverse, compiled and mapped, for each parameter, which is named."""
    scene = (EVERY | BOARDS)[name]
    points = jnp.asarray(np.random.default_rng(23).random((10, len(scene.needs)), dtype=np.float32))
    scene = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), scene)
    leaves, tree = jax.tree.flatten(scene)
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(scene)[0]]
    for i, path in enumerate(paths):

        def mean(leaf, i=i):
            return jnp.mean(tree.unflatten([*leaves[:i], leaf, *leaves[i + 1 :]])(points))

        parameter = re.escape(type(scene).__name__ + jax.tree_util.keystr(path))
        with pytest.raises(ValueError, match=f"{parameter} moves an edge.*qmcjax.boundary_gradient"):
            jax.grad(mean)(leaves[i])
    with pytest.raises(ValueError, match="moves an edge"):
        jax.jit(jax.jacfwd(lambda scene: jax.vmap(scene)(points)))(scene)
    # Something else can be differentiated, eagerly; the slope is the mean of the values of a program.
    slope = jax.grad(lambda a: jnp.mean(a * scene(points)))(jnp.float32(2.0))
    assert slope == pytest.approx(float(np.mean(evaluated(scene, points))), rel=1e-6)
