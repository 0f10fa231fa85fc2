"""The compiled search of whole worlds against programs of JAX that test all primitives one by one."""

from dataclasses import replace
from importlib.util import find_spec

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_trees import SPIN, blob, looped, mesh, same, searched

from qmcjax import tracing
from qmcjax.tracing import motion
from qmcjax.tracing.search import compiled_world, intersection, program

pytestmark = [
    pytest.mark.usefixtures("least_optimized"),
    pytest.mark.skipif(find_spec("numba") is None, reason="numba is not installed"),
]
WAY = compiled_world.search

FLAT = motion.affine(np.diag([1, 2, 0.5]), [0, 0, 1.0])


def all_kinds(key, count):
    """Return primitives of all kinds, some far out of the middle, triangles that move, and two meshes."""
    rng = np.random.default_rng(key)

    def vectors(scale=1.0):
        return scale * rng.uniform(-1, 1, (count, 3))

    low = vectors(2)
    return [
        tracing.plane([0, 0, -2.5], [0, 0.1, 1]),
        tracing.rectangle(vectors(2), vectors(), vectors()),
        tracing.disc(vectors(2), vectors(), rng.uniform(0.1, 1, count)),
        tracing.box(low, low + rng.uniform(0.05, 0.5, (count, 3))),
        tracing.sphere(vectors(2), rng.uniform(0.05, 0.4, count)),
        tracing.cylinder(vectors(2), vectors(), rng.uniform(0.02, 0.2, count)),
        tracing.triangles(rng.uniform(-1, 1, (count, 3, 3))),
        tracing.triangles(rng.uniform(-1, 1, (count, 3, 3)), rng.uniform(-1, 1, (count, 3, 3))),
        mesh(blob(12, 9)),
        mesh(blob(8, 7) * 0.6 + [1, 1, 0], blob(8, 7) * 0.5 - [0, 1, 0]),
    ]


WORLD = tracing.world(
    [
        *all_kinds(0, 5),
        # Programs that test all one by one take long to compile: kinds turn alone, below.
        tracing.group(all_kinds(1, 3)[::3], motion=SPIN),
        tracing.group(all_kinds(2, 2)[1:8:3], motion=FLAT),
    ],
    [
        tracing.rectangle_light([0, 0, 3], [1, 0, 0], [0, 1, 0], 1.0),
        tracing.sphere_light([3, 0, 0], 0.5, 1.0),
    ],
)


def given(count, dtype):
    """Return rays; the first along axes and in planes of faces, dead, or of no numbers."""
    rng = np.random.default_rng(3)
    origin, direction = rng.normal(size=(count, 3)) * 1.5, rng.normal(size=(count, 3))
    time, limit = rng.uniform(size=count), rng.choice([np.inf, 0.0, 0.3, 1.0, 2.0], count)
    direction[:200, 0] = 0
    direction[100:200, 1] = -0.0
    direction[200:210] = 0
    origin[210:213, 1] = np.nan, np.inf, -np.inf
    direction[213:215] = np.array([np.nan, np.inf])[:, None]
    return [jnp.asarray(a, dtype) for a in (origin, direction, time, limit)]


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_all_kinds(dtype):
    """Nearest and any hits, before limits and again from what is hit; dead rays and NaN hit nothing."""
    with jax.enable_x64(dtype == "float64"):
        rays = given(20000, dtype)
        wanted = looped(WORLD, *rays, False)
        for any_hit in (False, True):
            found = searched(WORLD, *rays, any_hit, WAY)
            same(found, wanted, any_hit)
            assert np.all(np.asarray(found[1])[200:215] == -1)
        hit = (np.asarray(wanted[1]) >= 0) & (np.arange(20000) > 215)
        assert 0.2 < hit.mean() < 0.9
        distance = np.asarray(wanted[0])
        origin, direction, time = (np.asarray(a) for a in rays[:3])
        # Rays that hit nothing are dead the second time, so that programs of the first time serve again.
        point = np.zeros_like(origin)
        point[hit] = origin[hit] + distance[hit, None] * direction[hit]
        other = np.random.default_rng(4).normal(size=point.shape)
        again = [jnp.asarray(a, dtype) for a in (point, other, time, np.where(hit, np.inf, 0))]
        same(searched(WORLD, *again, False, WAY), looped(WORLD, *again, False))


ONE_OF_EACH = {
    "plane": tracing.plane([0, 0, -1], [0, 0, 2.0]),
    "rectangle": tracing.rectangle([-1, -1, 0], [2, 0, 0.5], [0.5, 2, 0]),
    "disc": tracing.disc([0, 0, 0], [1, 1, 1], 1.0),
    "box": tracing.box([-1, -1, -1], [1, 0.5, 1]),
    "sphere": tracing.sphere([0, 0, 0], 1.0),
    "cylinder": tracing.cylinder([0, 0, -1], [0, 0.5, 2], 0.6, closed=False),
    "triangle": tracing.triangles([[[-1, -1, 0], [2, -1, 0], [-1, 2, 0.5]]]),
    "moving": tracing.triangles(
        [[[-1, -1, 0], [2, -1, 0], [-1, 2, 0.5]]], [[[-1, -1, 2], [2, -1, 1], [-1, 2, 0.5]]]
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_each_kind_alone(name):
    """In a space that moves: what is hit is the same, and so are distances."""
    rays = given(4000, "float32")
    world = tracing.world([tracing.group([ONE_OF_EACH[name]], motion=SPIN)])
    found, wanted = searched(world, *rays, False, WAY), looped(world, *rays)
    same(found, wanted)
    assert 0.01 < np.mean(np.asarray(found[1]) >= 0) < 0.9


def test_the_way_is_chosen_by_count():
    """Few primitives, and shapes that nobody knows, are tested by programs."""

    class Other(tracing.Sphere):
        pass

    if jax.default_backend() != "cpu":
        return
    few = tracing.world([tracing.sphere([0, 0, 0], 1.0)])
    many = tracing.world([tracing.sphere(np.random.default_rng(0).normal(size=(100, 3)), 0.1)])
    shape = many.objects[0].shapes[0]
    strange = tracing.world([tracing.Object((Other(shape.center, shape.radius),), None, None)])
    ways = [intersection._fastest(world)[1] for world in (few, many, strange)]
    assert ways == [program.by_program, WAY, program.by_program]


def test_all_pieces_are_done_once_and_errors_are_told():
    done = []
    compiled_world.share_work(done.append, range(100))
    assert sorted(done) == list(range(100))
    compiled_world.share_work(done.append, [])
    with pytest.raises(ZeroDivisionError):
        compiled_world.share_work(lambda piece: 1 // piece, [2, 0, 1])


@pytest.mark.slow
def test_trees_are_taken_over_only_by_the_same_numbers():
    """In one program; also with vertices of NaN, which hit nothing."""
    rng = np.random.default_rng(8)
    start, target = rng.normal(size=(200, 3)), rng.uniform(-0.6, 0.6, (200, 3))
    start *= 5 / np.linalg.norm(start, axis=1, keepdims=True)
    origin, direction = (jnp.asarray(a, jnp.float32) for a in (start, target - start))
    ends = jnp.zeros(200), jnp.full(200, jnp.inf)
    shape = mesh(blob(8, 7)).shapes[0]
    vertices = np.asarray(shape.vertices, np.float32)

    @jax.jit
    def find(vertices):
        world = tracing.world([tracing.Object((replace(shape, vertices=vertices),), None, None)])
        return searched(world, origin, direction, *ends, False, WAY)

    first, again = find(vertices), find(vertices)
    far, none, last = find(2 * vertices), find(np.nan * vertices), find(vertices)
    for a, b, c in zip(first, again, last, strict=True):
        assert np.array_equal(a, b) and np.array_equal(a, c)
    hit = np.asarray(first[1]) >= 0
    assert hit.sum() > 50 and np.all(np.asarray(far[0])[hit] < np.asarray(first[0])[hit])
    assert np.all(np.asarray(none[1]) == -1)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_lanes_are_numbers_side_by_side(dtype):
    """Operators with lanes and scalars, conditions, and what is chosen where one of two is NaN."""
    from qmcjax.tracing.search import lanes

    numba = pytest.importorskip("numba")

    @numba.njit(error_model="numpy")
    def computed(given, factor, out):
        a, b = lanes.load(given, 0), lanes.load(given, 1)
        lanes.store(out, 0, (a + b) * factor - a / b)
        lanes.store(out, 1, lanes.larger(a, b))
        lanes.store(out, 2, lanes.smaller(a, b))
        lanes.store(out, 3, lanes.larger(factor, a))
        here = ((a > b) | (b >= 1)) & (a != 0)
        return lanes.bits(here), lanes.bits((a < b) & (a <= factor)), lanes.larger(factor, 2 * factor)

    rng = np.random.default_rng(0)
    for _ in range(20):
        given, out = rng.normal(size=(2, lanes.WIDTH)).astype(dtype), np.empty((4, lanes.WIDTH), dtype)
        given[rng.integers(2), rng.integers(8)] = np.nan
        given[0, rng.integers(8)] = 0
        (a, b), factor = given, np.dtype(dtype).type(0.5)
        first, second, both = computed(given, factor, out)
        wanted = [
            (a + b) * factor - a / b,
            np.where(b > a, b, a),
            np.where(b < a, b, a),
            np.where(a > factor, a, factor),
        ]
        np.testing.assert_array_equal(out, np.stack(wanted))
        places = 2 ** np.arange(8)
        assert first == places[((a > b) | (b >= 1)) & (a != 0)].sum()
        assert second == places[(a < b) & (a <= factor)].sum()
        assert both == 1


def test_bits_are_visited_from_the_lowest_one_on():
    from qmcjax.tracing.search.lanes import lowest

    numba = pytest.importorskip("numba")

    @numba.njit
    def place(number):
        return lowest(number)

    assert [place(number) for number in (1, 2, 12, 128)] == [0, 1, 2, 7]
