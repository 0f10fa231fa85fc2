"""Line samples: exact visibility along lines of the screen, of lenses and of lights, and its derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import render, samplers, sequences, tracing
from qmcjax.tracing._intervals import fans, lines
from qmcjax.tracing._shapes.vectors import minus
from qmcjax.tracing.search.intersection import in_dtype

RNG = np.random.default_rng(5)
GREY = tracing.diffuse(0.7)


@pytest.fixture(autouse=True)
def _doubles():
    with jax.enable_x64(True):
        yield


def triangles(count, size):
    return RNG.normal([0, 0, 6], 1.2, (count, 1, 3)) + RNG.normal(size=(count, 3, 3)) * size


def sliding(*way):
    return tracing.motion.affine(None, tracing.motion.linear_segments([0, 1], [[0, 0, 0], way]))


WORLDS = {
    "spheres": [tracing.sphere(RNG.normal([0, 0, 6], 1.5, (12, 3)), RNG.uniform(0.1, 0.6, 12))],
    "from inside": [tracing.sphere([0.0, 0, 0], 3.0), tracing.sphere([0, 0.1, 2.9], 0.5)],
    "triangles": [tracing.triangles(triangles(20, 0.6))],
    "a tree": [tracing.triangles(triangles(300, 0.1))],
    "closing": [tracing.triangles(triangles(9, 0.6), close=triangles(9, 0.6))],
    "flat": [
        tracing.rectangle([-1, -1, 4], [2, 0, 0.5], [0, 2, 0.3]),
        tracing.box([-0.5, -0.5, 3], [0.8, 0.3, 3.8]),
        tracing.disc([0.4, 0.2, 2.5], [0.2, 0.3, 1], 0.6),
        tracing.plane([0, -1, 0], [0, 1, 0.1]),
    ],
    "cylinders": [
        tracing.cylinder([-0.5, -0.5, 4], [0.4, 0.8, 4.3], 0.3),
        tracing.cylinder([0.5, -0.5, 4], [0.6, 0.2, 3.0], 0.4),
    ],
    "moving": [
        tracing.sphere([0, 0, 5], 1.0, motion=sliding(1, 0.5, 0)),
        tracing.box([-1, -1, 4.5], [0, 0, 5.5], motion=sliding(0.3, 0.5, 0)),
    ],
}
COUNT = 24


def fan_of(kind, dtype):
    """Return fans across a screen, or over a lens: their rays meet in a point in focus.

    In mirrors, their rays start in a plane that cuts some objects.
    """
    y, zero = jnp.asarray(RNG.uniform(-0.3, 0.3, 64), dtype), jnp.zeros(64, dtype)
    if kind.endswith("in mirrors"):
        normal = zero + 0.1, zero - 0.2, zero + 0.9
        return fan_of(kind.split()[0], dtype)._replace(plane=(normal, zero + (-1.5 if "lens" in kind else 5)))
    if kind == "screen":
        return fans.eye(
            (zero, zero, zero), (zero - 0.4, y, zero + 1), (zero + 0.4, y + 0.1, zero + 1), zero + 0.5
        )
    focus = y, 0.7 * y, zero + 5.5
    first, last = (minus(focus, (x, y, zero)) for x in (zero - 0.5, zero + 0.5))
    return fans.Fan(focus, first, last, zero - 1, zero + 0.5, zero + 1e-6, zero + jnp.inf)


def rays_at(fan, t):
    """Return origins and directions at t (m, n)."""
    fan = jax.tree.map(lambda a: jnp.broadcast_to(a, t.shape), fan)
    return starting(fan, jnp.stack(fan.direction(t), axis=-1))


def starting(fan, direction):
    """Return where rays along directions (m, n, 3) start, and these."""
    begin = fan.begin
    if fan.plane is not None:
        begin = fan.plane[1] / jnp.sum(jnp.stack(fan.plane[0], axis=-1) * direction, axis=-1)
    return jnp.stack(fan.apex, axis=-1) + begin[..., None] * direction, direction


FANS = [
    ("screen", jnp.float32),
    ("lens", jnp.float64),
    ("screen in mirrors", jnp.float32),
    pytest.param("lens in mirrors", jnp.float64, marks=pytest.mark.slow),
]


def part_at(found, t):
    """Return the numbers of the parts that contain t (m, n); -1 for none."""
    start, end, number = (a[None] for a in (found.start, found.end, found.number))
    return jnp.where((start <= t[:, None]) & (t[:, None] < end), number, -1).max(axis=1)


@pytest.mark.parametrize("kind, dtype", FANS)
@pytest.mark.parametrize("name", WORLDS)
def test_parts_are_what_rays_hit(name, kind, dtype):
    world = in_dtype(lines.opened(tracing.world(WORLDS[name])), dtype)
    fan = fan_of(kind, dtype)
    found = jax.jit(lines.find_visible, static_argnums=2)(world, fan, COUNT)
    t = jnp.asarray(RNG.random((500, 64)), dtype)
    expected = tracing.nearest_hit(world, *rays_at(fan, t), 0.5).shape
    known = t < found.until[None]
    assert known.mean() > 0.9
    assert (known & (part_at(found, t) != expected)).mean() <= (0 if dtype == jnp.float64 else 1e-3)


@pytest.mark.parametrize("name", WORLDS)
def test_clear_parts_are_what_nothing_hides(name):
    world = lines.opened(tracing.world(WORLDS[name]))
    fan = fan_of("screen", jnp.float64)._replace(limit=jnp.full(64, 5.2))
    found = jax.jit(lines.find_clear, static_argnums=2)(world, fan, COUNT)
    t = jnp.asarray(RNG.random((500, 64)))
    hidden = tracing.any_hit(world, *rays_at(fan, t), 0.5, 5.2)
    clear, known = part_at(found, t) == lines.CLEAR, t < found.until[None]
    assert known.mean() > 0.9
    assert not jnp.any(known & (clear == hidden))


@pytest.mark.parametrize("clear", [False, True])
@pytest.mark.parametrize("kind, dtype", FANS)
@pytest.mark.parametrize("name", WORLDS)
def test_known_rays_all_see_the_same(name, kind, dtype, clear):
    """Of narrow pyramids, most are known; those at edges never are."""
    world = in_dtype(lines.opened(tracing.world(WORLDS[name])), dtype)
    limit = 5.2 if clear and "mirrors" not in kind else np.inf
    fan = fan_of(kind, dtype)._replace(limit=jnp.full(64, limit, dtype))
    start, end, aside = fan.direction(0.5), fan.direction(0.52), (0.002, 0.015, 0.0)
    moved = [tuple(d + a for d, a in zip(way, aside, strict=True)) for way in (start, end)]
    pyramid = fan._replace(first=start, last=moved[1], beside=(end, moved[0]))
    known, number = lines.find_known(world, pyramid, clear)
    # Near the middle of a sphere, what is seen may be ahead of its middle or not.
    assert known.mean() > 0.1 or (name, kind) == ("from inside", "lens")
    s, t = (jnp.asarray(RNG.random((500, 64)), dtype) for _ in range(2))
    ways = [a[None] + s * (b - a)[None] + c * t for a, b, c in zip(start, end, aside, strict=True)]
    fan = jax.tree.map(lambda a: jnp.broadcast_to(a, (500, 64)), fan)
    origin, direction = starting(fan, jnp.stack(ways, axis=-1))
    if clear:
        seen = jnp.where(tracing.any_hit(world, origin, direction, 0.5, limit), -1, lines.CLEAR)
    else:
        seen = tracing.nearest_hit(world, origin, direction, 0.5).shape
    assert not jnp.any(known[None] & (seen != number[None]))


def lamp(x):
    return tracing.rectangle_light(
        jnp.stack([x - 0.8, 2.2 + 0 * x, 0 * x - 0.8]), [1.6, 0, 0], [0, 0, 1.6], 6.0
    )


GLOW, DIM = tracing.emitter(0.7), tracing.emitter(0.2)


def objects_of(name, x, y, z):
    """Return two objects that move by x and y, and change by z."""
    center = jnp.stack([x, y, 0 * z])
    match name:
        case "ball":
            wall = tracing.rectangle([-3, -2, -1.5], [6, 0, 0], [0, 5, 0], material=DIM)
            return [tracing.sphere(center, 0.7 + z, material=GLOW), wall]
        case "shard through side":
            corners = jnp.array([[[-1.0, -0.8, 0.5], [0.9, -0.7, 0.8], [-0.4, 0.8, -0.6]]])
            shard = tracing.triangles(corners + center[None, None] + z, material=GLOW)
            corner = jnp.stack([-2 + 0 * y, -1 + y, -1 + 0 * y])
            return [shard, tracing.rectangle(corner, [4, 0, 0.2], [0, 0.6, 2.5], material=DIM)]
        case "pipe and coin":
            pipe = tracing.cylinder(
                center - jnp.array([0.6, 0.9, 0.0]), [0.5, 0.9, 0.2], 0.4 + y, material=GLOW
            )
            return [pipe, tracing.disc(center + 0.4, [0.3, 0.4, 1], 0.6 + z, material=DIM)]
        case "mirror":
            # The ball and the shard cut the mirror, whose edges are seen.
            corner = jnp.stack([-1.6 + 0 * x, -0.5 + y, -1.5 + 0 * z])
            floor = tracing.rectangle(corner, [3.2, 0.3, 0], [0, 0.2, 3], material=tracing.mirror(0.8))
            corners = jnp.array([[[-1.0, -0.8, 0.5], [-0.5, 0.7, -0.4], [-0.4, -0.8, -0.6]]])
            shard = tracing.triangles(corners + center[None, None] + z, material=GLOW)
            wall = tracing.rectangle([-4, -2, -3], [8, 0, 0], [0, 6, 0], material=tracing.emitter(0.4))
            ball = tracing.sphere(center - jnp.array([-0.4, 0.3, -0.6]), 0.4 + z, material=DIM)
            return [floor, shard, wall, ball]
        case "lit mirrors":
            # A box that moves, and a coin: both show the ball and its shadow.
            box = tracing.box(
                [-1.7, -0.9, -1.6],
                jnp.stack([-0.7 + x, 0.8 + 0 * x, -0.6 + z]),
                motion=sliding(0.3, 0.2, 0.1),
                material=tracing.mirror(0.8),
            )
            coin = tracing.disc(
                center + jnp.array([0.9, 0.2, -0.7]), [-0.6, 0.2, 1], 0.7 + z, material=tracing.mirror(0.6)
            )
            return [*objects_of("shadow", x, y, z), box, coin]
        case "shadow":
            floor = tracing.rectangle([-2, -0.9, -2], [0, 0, 4], [4, 0, 0], material=GREY)
            return [floor, tracing.sphere(center, 0.5 + z, material=GREY)]


def scene_of(name, theta, chosen, **options):
    """Return a scene that moves objects by theta[:3], a light and the camera by theta[3]."""
    x, y, z, w = jnp.asarray(theta)
    lights = [lamp(w)] if name in ("shadow", "paths", "lit mirrors") else []
    lens = {"aperture": 0.3 + z, "focus": 2.5 + z} if name in ("defocus", "mirror and lens") else {}
    position = jnp.stack([0.2 + w, 0.5 + 0 * w, 4.0 + 0 * w])
    camera = tracing.camera(position, [0, 0, 0], fov=45.0 + z, **lens)
    objects = {"defocus": "shard through side", "paths": "shadow", "mirror and lens": "mirror"}.get(
        name, name
    )
    world = tracing.world(objects_of(objects, x, y, z), lights)
    if name == "paths":
        return tracing.path_tracing(world, camera, 1, lines=chosen, **options)
    return tracing.direct_light(world, camera, int("mirror" in name), lines=chosen, **options)


def points_of(scene, count):
    return jnp.asarray(RNG.random((count, len(scene.needs))))


SCENES = {
    "ball": ("x",),
    "shard through side": ("x",),
    "pipe and coin": ("x",),
    "shadow": ("x", "light_u"),
    "defocus": ("lens_u",),
    "mirror": ("x",),
    "lit mirrors": ("x", "light_u"),
}
OTHER = {"x": "y", "light_u": "light_v", "lens_u": "lens_v"}

THETA = np.array([0.13, 0.05, 0.02, 0.03])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pipe and coin", "defocus", "mirror"])
def test_derivatives_are_those_of_finite_differences(name):
    """A line is a continuous function of all parameters: its derivative is that of its own differences.

    Those of the figure's scenes are tested there.
    """
    points = points_of(scene_of(name, THETA, ()), 60)
    weights = jnp.asarray(RNG.random((60, 1)))

    def value(theta):
        return jnp.sum(weights * scene_of(name, theta, SCENES[name]).with_size(3, 2)(points))

    found, compiled = jax.jit(jax.grad(value))(jnp.asarray(THETA)), jax.jit(value)
    step = 1e-5
    for k in range(4):
        move = jnp.zeros(4).at[k].set(step)
        expected = (compiled(THETA + move) - compiled(THETA - move)) / (2 * step)
        np.testing.assert_allclose(found[k], expected, rtol=2e-4, atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball", "shadow", "defocus", "mirror"])
def test_lines_in_both_directions_agree_with_those_in_one(name):
    """Means of values and derivatives, within 5 sigma; and derivatives are bounded."""
    points = points_of(scene_of(name, THETA, ()), 2**13)

    def both(chosen):
        def value(theta):
            return scene_of(name, theta, chosen).with_size(3, 2)(points)[:, 0]

        moved = jax.jit(lambda theta, move: jax.jvp(value, (theta,), (move,)))
        values = [moved(jnp.asarray(THETA), move) for move in jnp.eye(4)]
        return np.stack([values[0][0], *(slope for _, slope in values)])

    one, two = both(SCENES[name]), both(SCENES[name] + tuple(map(OTHER.get, SCENES[name])))
    difference = two - one
    assert (abs(difference.mean(axis=1)) <= 5 * difference.std(axis=1) / np.sqrt(2**13)).all()
    # At the poles of the ball derivatives by lines in one direction are a hundred times as large.
    assert abs(two[1:]).max() < (0.1 if name == "ball" else 0.5) * abs(one[1:]).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, intervals, parallel",
    [
        (name, *of)
        for name in (*SCENES, "paths", "mirror and lens")
        for of in ((1, 3), (8, 1))
        if of == (8, 1) or name != "lit mirrors"  # It compiles for minutes.
    ],
)
def test_means_are_those_of_points(name, intervals, parallel):
    """Also where parts do not fit: within 5 sigma."""
    count = 2**14
    chosen = {**SCENES, "mirror and lens": ("lens_u",)}.get(name, ("x",))
    chosen += tuple(map(OTHER.get, chosen))
    options = {"intervals": intervals, "parallel": parallel}
    lined = scene_of(name, THETA, chosen, **options).with_size(5, 3)
    points = points_of(lined, count)
    one, other = (np.asarray(jax.jit(scene)(points))[:, 0] for scene in (lined, scene_of(name, THETA, ())))
    difference = one - other
    assert abs(difference.mean()) <= 5 * difference.std() / np.sqrt(count)
    if intervals == 8:
        assert one.var() < other.var()


@pytest.mark.parametrize("mirrors", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_screen_area_of_a_ball_and_its_derivative(mirrors):
    """A ball at distance D on the axis covers a disc of radius tan(asin(r / D)) at distance 1.

    In a mirror that covers the image, too, of a ball behind the camera.
    """
    height = 0.5 * 0.8 / np.sqrt(16 - 0.8**2) / np.tan(np.pi / 9)
    angle = (jnp.arange(400.0) + 0.5) * np.pi / 400

    def scene_of_ball(radius, chosen, parallel):
        ball = tracing.sphere([0, 0, 6 * mirrors], radius, material=tracing.emitter(1.0))
        mirror = [tracing.plane([0, 0, 3], [0, 0, 1], material=tracing.mirror(1.0))][:mirrors]
        world, camera = tracing.world([ball, *mirror]), tracing.camera([0, 0, 4], [0, 0, 0])
        return tracing.direct_light(world, camera, mirrors, lines=chosen, parallel=parallel)

    def mean(radius):
        # Chords, and more so their derivatives, are not smooth at both poles.
        y = 0.5 + height * jnp.cos(angle)
        values = scene_of_ball(radius, "x", 1)(jnp.stack([jnp.full_like(y, 0.3), y], axis=-1))[:, 0]
        return jnp.sum(values * jnp.sin(angle)) * height * np.pi / 400

    def mean_of_parallels(radius):
        """By one sample of 512 lines across the image."""
        return scene_of_ball(radius, ("x", "y"), 256)(jnp.full((1, 2), 0.123))[0, 0]

    def exact(radius):
        return np.pi * radius**2 / (16 - radius**2) / (2 * np.tan(np.pi / 9)) ** 2

    found = jax.jit(jax.value_and_grad(mean))(0.8)
    expected = exact(0.8), (exact(0.8001) - exact(0.7999)) / 0.0002
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    np.testing.assert_allclose(jax.jit(jax.value_and_grad(mean_of_parallels))(0.8), expected, rtol=2e-3)


def test_a_lens_in_focus_sees_as_a_pinhole():
    """What lies in the plane of focus is one point for all rays of a line: it is hit there."""
    board = tracing.rectangle([-2, -2, 0], [1.7, 0, 0], [0, 4, 0], material=GLOW)
    world = tracing.world([board, tracing.plane([0, 0, -3], [0, 0, 1], material=DIM)])
    points = points_of(tracing.direct_light(world, tracing.camera([0, 0, 4], [0, 0, 0], aperture=0.5)), 200)
    pinhole = tracing.direct_light(world, tracing.camera([0, 0, 4], [0, 0, 0]))
    lens = tracing.camera([0, 0, 4], [0, 0, 0], aperture=0.5)
    found = tracing.direct_light(world, lens, lines="lens_u")(points)[:, 0]
    np.testing.assert_allclose(found, pinhole(points[:, :2])[:, 0], rtol=1e-12)


def test_chords_are_uniform_on_the_lens():
    """The area below a chord is that of a segment of the circle; both ends are on the circle."""
    camera = tracing.camera([0, 0, 0], [0, 0, -1], aperture=2.0, focus=3.0)
    v = jnp.concatenate([jnp.linspace(0, 1, 1001), jnp.array([1e-12, 1e-4, 0.5 - 1e-9])])
    middle = jnp.full_like(v, 0.5)
    first, last, focus = camera.chord(middle, middle, middle, v, v < 0, 0 * v)
    upright, _, _ = camera.chord(middle, middle, middle, v, v >= 0, 0 * v)
    np.testing.assert_array_equal(jnp.stack(upright), jnp.stack([first[1], first[0], first[2]]))
    height = first[1] / 2
    np.testing.assert_allclose(
        0.5 + (height * np.sqrt(1 - height**2) + np.arcsin(height)) / np.pi, v, atol=1e-13
    )
    np.testing.assert_allclose(jnp.hypot(first[0], first[1]), 2, rtol=1e-14)
    np.testing.assert_array_equal(jnp.stack(last), jnp.stack([-first[0], *first[1:]]))
    np.testing.assert_allclose(jnp.stack(focus), jnp.stack([0 * v, 0 * v, 0 * v - 3]), atol=1e-13)


@pytest.mark.parametrize("chosen", ["x", "y", ("x", "y")])
def test_all_lines_of_stratified_samples_are_stratified(chosen):
    """Each sees as much of a triangle as its coordinate says: their mean is known to half a stratum."""
    corners = [[[-9.0, -9, -1], [9, 9, -1], [9, -9, -1]]]
    world = tracing.world([tracing.triangles(corners, material=tracing.emitter(1.0))])
    scene = tracing.direct_light(world, tracing.camera([0, 0, 0], [0, 0, -1]), lines=chosen, parallel=4)
    found = scene(sequences.sobol(2)(np.arange(4)).astype(jnp.float64)).mean(axis=0)
    assert 0 < abs(found - 0.5).max() <= 0.5 / (4 * 4) + 1e-12


@pytest.mark.parametrize("chosen", ["x", "y", ("x", "y")])
def test_render_tells_the_size(chosen):
    scene = scene_of("ball", THETA, chosen)
    sampler = samplers.full_screen(sequences.sobol(2), 4, 3)
    image = render(scene, sampler, 4, 3, 64, dtype=jnp.float64)
    x, y = (jnp.arange(400.0) + 0.5) / 400, (jnp.arange(300.0) + 0.5) / 300
    points = jnp.stack(jnp.broadcast_arrays(x, y[:, None]), axis=-1)
    expected = jax.jit(scene_of("ball", THETA, ()))(points).reshape(3, 100, 4, 100, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(image, expected, atol=0.03)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_degenerate_figures_have_finite_derivatives(scale):
    """Flat triangles, edges seen along their length, a ball around the eye, in float32."""
    flat = [[[0, 0, 0], [0, 0, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]]
    on_edge, twice = [[[-1, 0, 0], [1, 0, 0], [0, 0, 5]]], [[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]] * 2
    corners = jnp.array([*flat, *on_edge, *twice], jnp.float32)

    def value(size):
        objects = [
            tracing.triangles(corners * size, material=tracing.emitter(1.0)),
            tracing.sphere([0, 0, 5 * scale], size, material=tracing.emitter(0.5)),
        ]
        scene = tracing.direct_light(
            tracing.world(objects), tracing.camera([0, 0, 5 * scale], [0, 0, 0]), lines="x"
        )
        y = jnp.asarray([0.0, 0.25, 0.5, 0.75, 1.0], jnp.float32)
        return scene(jnp.stack([y, y], axis=-1)).sum()

    found = jax.jit(jax.value_and_grad(value))(jnp.float32(scale))
    assert np.isfinite(found).all()


def test_edges_without_lines_are_named():
    def value(theta, name, chosen):
        if name == "mirrors":
            ball = tracing.sphere(theta[:3], 0.5, material=tracing.mirror(1.0) if chosen == "y" else None)
            flat = tracing.rectangle([-1, -1, 0], [2, 0, 0], [0, 2, 0], material=tracing.mirror(1.0))
            camera = tracing.camera([0, 0, 4], [0, 0, 0])
            scene = tracing.direct_light(tracing.world([ball, flat]), camera, 2, lines=chosen)
        else:
            scene = scene_of(name, theta, chosen)
        return scene(jnp.full((1, len(scene.needs)), 0.3)).sum()

    for of, chosen, edges in (
        ("mirrors", "y", "reflections in round mirrors"),
        ("mirrors", "x", "reflections of reflections"),
        ("shadow", "x", "shadows"),
        ("shadow", "light_u", "what the camera sees"),
        ("paths", "x", "what later parts of paths see"),
    ):
        with pytest.raises(
            ValueError,
            match=rf"center \(by {edges}, which no line covers; .*a fifth too small\) moves an edge",
        ):
            jax.grad(value)(jnp.asarray(THETA), of, chosen)


def test_lines_that_cannot_be_numbered_are_refused():
    world = tracing.world([tracing.sphere([0, 0, 0], 1.0)])
    scene = tracing.direct_light(world, tracing.camera([0, 0, 4], [0, 0, 0]), lines=("x", "y"), parallel=256)
    with pytest.raises(ValueError, match="points of 512 lines each must be fewer than 4194304, got 4194304"):
        jax.eval_shape(scene, jax.ShapeDtypeStruct((2**22, 2), jnp.float32))


@pytest.mark.parametrize("chosen", ["x", ("y", "light_v")])
def test_no_points_have_no_values(chosen):
    scene = scene_of("shadow", THETA, chosen)
    assert scene(jnp.zeros((0, len(scene.needs)))).shape == (0, 3)


def test_wrong_lines_are_refused():
    world, camera = tracing.world([tracing.sphere([0, 0, 0], 1.0)]), tracing.camera([0, 0, 5], [0, 0, 0])
    for wrong, error in (
        ("z", ValueError),
        (3, TypeError),
        (["x", "x"], ValueError),
        ("light_u", ValueError),
        ("lens_u", ValueError),
    ):
        with pytest.raises(error, match=r"^lines must"):
            tracing.direct_light(world, camera, lines=wrong)
    with pytest.raises(ValueError, match=r"^parallel must"):
        tracing.direct_light(world, camera, lines="x", parallel=0)
    lens, blades = (tracing.camera([0, 0, 5], [0, 0, 0], aperture=0.1, blades=n) for n in (None, 5))
    for of, wrong in ((lens, ("y", "lens_v")), (blades, "lens_v")):
        with pytest.raises(ValueError, match=r"^lines must have 'lens_v' only"):
            tracing.path_tracing(world, of, 1, lines=wrong)
    with pytest.raises(ValueError, match=r"^scene must have no lines"):
        tracing.analytic_visibility(tracing.direct_light(world, camera, lines="x"))


def test_checkpoints_of_lines_and_of_points_differ(tmp_path):
    sampler = samplers.full_screen(sequences.sobol(2), 4, 3)

    def image(chosen):
        return render(scene_of("ball", THETA, chosen), sampler, 4, 3, 4, checkpoint=tmp_path / "image")

    image("x")
    with pytest.raises(ValueError, match="checkpoint"):
        image(())
