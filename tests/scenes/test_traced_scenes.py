"""The ray-traced scenes: what they need, that they are functions of points, and what is stored of them."""

import io
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scene_tables import evaluated, varied

import qmcjax as qj
from analysis.tables import traced_references
from qmcjax import samplers, scenes, sequences, tracing
from qmcjax.core.checkpoints import digest
from qmcjax.scenes import traced
from qmcjax.scenes.traced import _base, _vehicles
from qmcjax.tracing import motion
from qmcjax.tracing._shapes.triangles import build_tree
from qmcjax.tracing._world import factories

pytestmark = pytest.mark.usefixtures("least_optimized")

X64 = jax.enable_x64

MOVING = ("cornell_box", "helicopter", "sports", "moving triangles")

SCENES = {name: getattr(scenes, name) for name in traced.NAMES} | {
    "still box": partial(scenes.cornell_box, 0.3),
    "original box": partial(
        scenes.cornell_box, 0.0, ball=False, mirror=False, blocks=True, light=0.5, bounces=2
    ),
    "still helicopter": partial(scenes.helicopter, 0.3),
    "still car": partial(scenes.sports, 0.3),
    "pinhole": partial(scenes.defocus, None),
    "hexagonal": partial(scenes.defocus, blades=6),
    "mirror ring": partial(scenes.caustic, roughness=None, light_bounces=0),
    "roulette": partial(scenes.interior, 3, roulette=1),
    "moving triangles": scenes.moving_triangles,
}

EAGER = "mirror ring"
"""Other programs take minutes to run one operation at a time."""


COUNT = 2**12
"""Points of all tests: a scene compiles for seconds, and then serves every test that evaluates it."""


def points(scene, dtype=jnp.float32, key=1):
    with X64(dtype == jnp.float64):
        return sequences.owen(sequences.sobol(len(scene.needs)), key).points(COUNT, dtype=dtype)


@pytest.mark.parametrize("name", SCENES)
def test_what_is_needed(name):
    """Time only where the shutter is open, a lens only where there is one, nothing twice."""
    scene = SCENES[name]()
    needs = scene.needs
    assert needs[:2] == ("x", "y") and len(set(needs)) == len(needs)
    assert ("time" in needs) == (name in MOVING)
    assert ("lens_u" in needs) == (name in ("defocus", "hexagonal"))
    assert ("roulette1" in needs) == (name == "roulette")
    # More than one sample in a program are as many copies of a long one to compile.
    assert scene.unrolled == scene.estimator.unrolled == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_values(name):
    """They are finite, not negative, neither dark nor white, in any order; compiled or not."""
    scene = SCENES[name]()
    given = points(scene)
    value = evaluated(scene, given)
    assert value.shape == (COUNT, 3) and value.dtype == jnp.float32
    assert jnp.isfinite(value).all() and (value >= 0).all() and (value.std(axis=0) > 0.01).all()
    assert 0.05 < value.mean() < 0.6
    # Fused programs round differently: a ray along an edge may fall to the other side.
    others = [evaluated(scene, given[::-1])[::-1][:64], *([scene(given[:64])] if name == EAGER else [])]
    for other in others:
        assert jnp.isclose(other, value[:64], rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.95


@pytest.mark.slow
def test_paths_of_light_find_the_caustic():
    """The standard error of an image is less than two thirds of that by paths from the camera alone."""

    def error(light_bounces):
        scene = scenes.caustic(light_bounces=light_bounces)
        given = np.random.default_rng(1).random((2**18 // COUNT, COUNT, len(scene.needs)), np.float32)
        values = np.concatenate([np.asarray(evaluated(scene, some), np.float64) for some in given])
        # Between pixels the mean differs, less than samples do within them.
        return values.std(axis=0).mean(), values.mean(axis=0)

    (without, mean), (joined, other) = error(0), error(1)
    assert joined < 2 / 3 * without
    np.testing.assert_allclose(mean, other, atol=5 * np.hypot(without, joined) / 2**9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_box", "defocus", "caustic"])
def test_precisions_agree(name):
    """In float64 some rays go another way, but not the mean."""
    scene = SCENES[name]()
    single = np.asarray(evaluated(scene, points(scene)), np.float64)
    with X64(True):
        double = np.asarray(evaluated(scene, points(scene, jnp.float64)))
    assert double.dtype == np.float64
    assert np.isclose(single, double, rtol=1e-2, atol=1e-3).all(axis=-1).mean() > 0.98
    assert np.allclose(single.mean(axis=0), double.mean(axis=0), rtol=1e-2)


def test_the_ball_touches_the_floor_and_jumps():
    """Its path passes the floor, where its direction jumps, at the double knot."""
    ball = scenes.cornell_box().estimator.world.objects[-1]
    path, radius = ball.motion.translation, float(ball.shapes[0].radius[0])
    time = np.linspace(0, 1, 2001)
    with X64(True):
        height = np.asarray(jax.jit(path)(time))[:, 1]
        (corner,) = path.corners
        assert float(path(jnp.asarray(corner))[1]) == pytest.approx(radius, abs=1e-12)
    assert height.min() >= radius - 1e-12
    slopes = np.diff(height) / np.diff(time)
    before, after = (slopes[np.searchsorted(time, corner) + k] for k in (-2, 1))
    assert before < -1 and after > 1


@pytest.mark.slow
def test_rotors_turn_about_the_mast_in_opposite_directions():
    """Points of a blade stay at their distance from the hub, which flies with the hull."""
    hull, _, lower, upper, _ = scenes.helicopter().estimator.world.objects
    time = jnp.linspace(0, 1, 64)
    matrix, centre = hull.motion(time)
    for rotor, sign in ((lower, 1), (upper, -1)):
        turned, hub = rotor.motion(time)
        local = jnp.einsum("nji,njk->nik", matrix, turned)
        angle = jnp.unwrap(jnp.arctan2(local[:, 0, 2], local[:, 0, 0]))
        assert float(angle[-1] - angle[0]) == pytest.approx(sign * 2 * np.pi * 2.25, abs=1e-4)
        assert jnp.allclose(local[:, 1], jnp.array([0.0, 1.0, 0.0])[None], atol=1e-5)
        mast = jnp.einsum("nji,nj->ni", matrix, hub - centre)
        assert jnp.allclose(mast[:, [0, 2]], 0, atol=1e-5)


def test_wheels_roll_without_sliding():
    """The point of a wheel at the bottom does not move."""
    wheel = scenes.sports(distance=0.7).estimator.world.objects[3]
    radius = 0.36

    def bottom(time, start):
        matrix, moved = wheel.motion(start[None])
        arm = matrix[0].T @ (jnp.array([0.0, -radius, 0.0]))
        matrix, moved = wheel.motion(time[None])
        return matrix[0] @ arm + moved[0]

    start = jnp.float32(0.4)
    velocity = jax.jit(jax.jacfwd(bottom))(start, start)
    assert jnp.allclose(velocity, 0, atol=1e-5)


def test_the_camera_follows_the_car():
    scene = scenes.sports()
    time = jnp.linspace(0, 1, 5)
    _, camera = scene.estimator.camera.motion(time)
    _, car = scene.estimator.world.objects[0].motion(time)
    assert jnp.array_equal(camera, car) and float(car[-1, 0] - car[0, 0]) == pytest.approx(1.5)


def test_meshes_are_closed():
    """Each edge belongs to two triangles, which run along it in opposite ways; normals point outside."""
    hull = scenes.helicopter().estimator.world.objects[0].shapes[0].vertices
    car = scenes.sports().estimator.world.objects
    for mesh in (hull, car[0].shapes[0].vertices, car[1].shapes[0].vertices):
        edges = [(tuple(t[k]), tuple(t[(k + 1) % 3])) for t in np.asarray(mesh) for k in range(3)]
        assert len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)
        a, b, c = np.moveaxis(np.asarray(mesh, np.float64), 1, 0)
        assert np.sum(a * np.cross(b, c)) / 6 > 0.1  # the volume


def test_a_spin_is_exact_after_many_turns():
    """The angle of the last of a million turns is that of the first."""
    spin = _vehicles.Spin(np.array([0.0, 0.0, 2.0]), np.array(0.125), np.array(2.0**20))
    assert jnp.allclose(spin(jnp.float32(1)), spin(jnp.float32(0)), atol=1e-6)


def test_blades_are_of_an_aperture():
    with pytest.raises(ValueError, match=r"^blades must be None without an aperture"):
        scenes.defocus(None, blades=5)


def noisy(rng, side):
    image = rng.random((side, side, 3)) * 10 ** rng.uniform(-4, 2, (side, side, 1))
    error = 1e-3 * 2 ** rng.normal(size=(side, side))
    error[0, 0] = 0
    return image, error


def test_images_are_stored_below_their_errors():
    """Values are off by less than half the median error, errors raised by 10 % or next to nothing."""
    image, error = noisy(np.random.default_rng(1), 16)
    error[1, :4] = 1e-9, 1e-12, 1e-19, 1e-3 * 2**10
    of, file = traced.content(scenes.caustic()), io.BytesIO()
    traced.save(file, image, error, of)
    file.seek(0)
    stored = traced.read(file)
    assert abs(stored.image - image).max() <= stored.rounding <= 0.25 * np.median(error[error > 0])
    assert stored.error[0, 0] == 0 and (stored.error >= error * (1 - 1e-12)).all()
    assert (stored.error <= np.maximum(1.1 * error, 1e-9 * error.max())).all() and stored.content.matches(of)


def test_scenes_are_told_apart_by_what_they_are_made_of():
    """Any number and any choice counts, but not in which precision it came."""
    of = traced.content(scenes.caustic())
    assert of.matches(traced.content(scenes.caustic()))
    assert of.matches(traced.content(scenes.caustic(jnp.float32(0.05))))
    for other in (scenes.caustic(0.051), scenes.caustic(light_bounces=2), scenes.caustic(roughness=0.1)):
        assert not of.matches(traced.content(other))
    contents = [traced.content(SCENES[name]()) for name in SCENES]
    for k, one in enumerate(contents):
        assert [one.matches(other) for other in contents] == [j == k for j in range(len(contents))]


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_what_it_was_given(name, monkeypatch):
    """Another processor rounds otherwise, and may order the triangles of trees otherwise."""
    scene = SCENES[name]()
    turned = lambda *ends: build_tree(*(-x for x in ends if x is not None))  # noqa: E731
    monkeypatch.setattr(factories, "build_tree", turned)
    other = SCENES[name]()
    assert (other == scene) == (scene.name not in ("helicopter", "sports"))
    assert traced.content(other).matches(traced.content(scene))
    assert digest("scene", other) == digest("scene", scene)
    if name in traced.NAMES:
        assert other.reference(8, 8)[0].shape == (8, 8, 3)


def store_reference(monkeypatch, folder, name, side):
    """Make the stored image of a scene, small, with 64 samples per pixel."""
    for constant, value in (("SIDE", side), ("SPP", 2**6), ("CACHE", folder / "cache")):
        monkeypatch.setattr(traced_references, constant, value)
    (content,) = traced_references.table(name)
    (folder / f"{name}.npz").write_bytes(content)


@pytest.fixture
def stored(monkeypatch, tmp_path):
    """Store an image of the caustic, and take stored images from there."""

    def replicate(scene, number, side, spp):
        rng = np.random.default_rng(number)
        return (0.5 + 0.01 * rng.normal(size=(side, side, 3)) / np.sqrt(spp)).astype(np.float32)

    monkeypatch.setattr(traced_references, "replicate", replicate)
    monkeypatch.setattr(_base, "FOLDER", tmp_path)
    _base.load.cache_clear()
    store_reference(monkeypatch, tmp_path, "caustic", 12)
    yield tmp_path
    _base.load.cache_clear()


def test_a_reference_is_the_mean_of_the_stored_one(stored):
    image, bound = scenes.caustic().reference(12, 12)
    assert image.shape == bound.shape == (12, 12, 3) and image.dtype == bound.dtype == np.float64
    assert (abs(image - 0.5) < bound).all()
    assert 5 * 0.01 / 8 < np.median(bound) < 5 * 0.03 / 8
    smaller, smaller_bound = scenes.caustic().reference(4, 6)
    assert np.allclose(smaller, image.reshape(6, 2, 4, 3, 3).mean(axis=(1, 3)))
    assert 0.3 < smaller_bound.mean() / bound.mean() < 0.6  # 6 pixels have errors 1 / sqrt(6) as large
    bound[:] = 0
    assert (scenes.caustic().reference(12, 12)[1] > 0).all()


@pytest.mark.parametrize(
    ("scene", "size", "message"),
    [
        (scenes.caustic(), (5, 12), "width must divide 12, the side of the stored reference, got 5"),
        (scenes.caustic(), (12, 24), "height must divide 12"),
        (scenes.caustic(bounces=2), (12, 12), "caustic has a stored reference for its default parameters"),
        (scenes.occluder(), (12, 12), "occluder has no stored reference"),
        (replace(scenes.caustic(), name="made up"), (12, 12), "made up has no stored reference"),
    ],
)
def test_other_references_are_errors_that_help(stored, scene, size, message):
    with pytest.raises(ValueError, match=rf"^{message}.*: qmcjax.estimated_reference\(.*\) makes one$"):
        scene.reference(*size)


def test_a_traced_scene_has_no_reference(stored):
    def side(radius):
        return scenes.caustic(radius).reference(4, 4)[0].sum()

    with pytest.raises(TypeError, match=r"^scene must be known before tracing"):
        jax.jit(side)(0.8)


def test_replicates_that_are_finished_stay(stored, monkeypatch):
    """What is stopped in the middle goes on there, and what was made of another scene is not taken."""
    made = []

    def replicate(scene, number, side, spp):
        if len(made) == 5:
            raise KeyboardInterrupt
        made.append(number)
        return np.zeros((side, side, 3), np.float32)

    monkeypatch.setattr(traced_references, "replicate", replicate)
    take = partial(traced_references.replicates, side=4, spp=2, cache=stored / "other")
    with pytest.raises(KeyboardInterrupt):
        take(scenes.caustic())
    made.clear()
    with pytest.raises(KeyboardInterrupt):
        take(scenes.caustic())
    assert made == [5, 6, 7, 8, 9]
    made.clear()
    with pytest.raises(KeyboardInterrupt):
        take(scenes.caustic(0.5))
    assert made == [0, 1, 2, 3, 4]
    assert not list(stored.glob("**/*.part.*"))


def estimated(scene, side):
    """Return means over pixels and bounds of their errors: 5 standard errors, at least twice the usual."""
    spp = COUNT // side**2
    y, x = np.divmod(np.arange(COUNT) // spp, side)
    images = []
    for key in range(16):
        given = np.array(points(scene, key=key))
        given[:, :2] = (given[:, :2] + np.stack([x, y], axis=1)) / side
        images.append(np.float64(evaluated(scene, given)).reshape(side, side, spp, 3).mean(axis=2))
    error = np.std(images, axis=0, ddof=1) / 4
    usual = np.sqrt(np.mean(error**2))
    return np.mean(images, axis=0), 5 * np.clip(2 * usual, error, error.max())


@pytest.mark.slow
@pytest.mark.parametrize("name", traced.NAMES)
def test_stored_references_are_of_the_scenes_as_they_are(name):
    """What is shipped is what the program would estimate today; what is not shipped is said to be missing."""
    scene = getattr(scenes, name)()
    if traced.load(name) is None:
        with pytest.raises(ValueError, match=f"{name} has no stored reference: qmcjax.estimated_reference"):
            scene.reference(8, 8)
        return
    image, bound = scene.reference(8, 8)
    estimate, own = estimated(scene, 8)
    assert (abs(image - estimate) <= bound + own).all()


SIDE = 32


def path(*points):
    return motion.linear_segments(np.linspace(0, 1, len(points)), points)


def spin(time):
    return motion.quaternion([0.0, 1.0, 0.0], 2 * np.pi * time)


def scene(**options):
    """Return a ball that flies and a box that spins, over a floor, under two lights; most is sky."""
    ball = tracing.sphere([0, 0, 0], 0.3, motion=motion.affine(None, path([-1, 1, 0], [-0.4, 0.7, 0])))
    box = tracing.box([-0.2, 0, -0.3], [0.2, 0.2, 0.3], motion=motion.affine(spin, [0.9, 0.1, 0.4]))
    floor = tracing.rectangle([-4, 0, 2], [8, 0, 0], [0, 0, -6])
    still = tracing.cylinder([0, 0, -1], [0, 1.2, 0], 0.2)
    panel = tracing.rectangle_light([1, 3, 0], [0.5, 0, 0], [0, 0, 0.5], 20.0)
    lamps = [tracing.point_light([-1, 4, 1], 20.0), panel]
    camera = tracing.camera([0, 1.3, 5], [0, 0.8, 0], **options)
    return tracing.direct_light(tracing.world([ball, box, floor, still], lamps), camera)


def chrome():
    mirror = tracing.sphere([0.6, 0.5, 0], 0.5, material=tracing.mirror())
    ball = tracing.sphere([0, 0, 0], 0.2, motion=motion.affine(None, path([-1, 1, 0], [-0.6, 0.7, 0])))
    world = tracing.world([mirror, ball], [tracing.point_light([0, 4, 4], 20.0)])
    return tracing.direct_light(world, tracing.camera([0, 0.7, 5], [0, 0.5, 0]), mirrors=1)


def indirect():
    """Return a world and a camera: whatever is seen depends on what moves."""
    plane = tracing.plane([0, 0, 0], [0, 1, 0])
    opened = np.array([[[0, 1, 0], [1, 1, 0], [0, 2, 0.0]]])
    closing = tracing.triangles(opened, np.add(opened, [[[0, 0, 0], [0, 0, 1], [0, 0, 0]]]))
    camera = tracing.camera([0, 1, 5], [0, 1.2, 0])
    lights = [tracing.environment(1.0), tracing.point_light([2, 5, 2], 20.0)]
    return tracing.world([plane, closing], lights), camera


@pytest.mark.slow
def test_what_moves_out_of_sight_shades_the_sky():
    """An environment shines from everywhere: a ball that the camera does not see shades the floor it sees."""
    floor = tracing.plane([0, 0, 0], [0, 1, 0])
    ball = tracing.sphere([0, 0, 0], 0.5, motion=motion.affine(None, path([0, 2, 3], [0, 2, 0])))
    camera = tracing.camera([0, 1, 0], [0, 0, 0], up=[0, 0, 1], fov=10)
    scene = tracing.direct_light(tracing.world([floor, ball], [tracing.environment(1.0)]), camera)
    upwards = jnp.full(len(scene.needs), 0.5)
    time = scene.needs.index("time")
    ends = jnp.stack([upwards.at[time].set(0.0), upwards.at[time].set(0.999)])
    assert evaluated(scene, ends)[:, 0].tolist() == [0.5, 0.0]
    assert varied(scene, jnp.zeros_like(upwards), jnp.ones_like(upwards))[time]


VARYING = {
    "pinhole": scene,
    "lens": lambda: scene(aperture=0.05, focus=4.0),
    "mirror": chrome,
    "paths": lambda: tracing.path_tracing(*indirect(), 1),
    "resampled": lambda: tracing.resampled_light(scene().world, scene().camera, 4),
    "bidirectional": lambda: tracing.bidirectional(*indirect(), 1),
}


def boxes(scene):
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    low = np.stack([x, y, *[0 * x] * (len(scene.needs) - 2)], axis=-1) / SIDE
    high = low.copy()
    high[..., :2] += 1 / SIDE
    high[..., 2:] = 1
    return jnp.asarray(low, jnp.float32), jnp.asarray(high, jnp.float32)


@pytest.mark.slow
@pytest.mark.parametrize("name", VARYING)
def test_what_does_not_vary_does_not_matter(name):
    """Samples in each pixel: those coordinates anywhere, against the same samples with them at 1/2."""
    scene = VARYING[name]()
    low, high = boxes(scene)
    varies = varied(scene, low, high)
    assert varies.shape == low.shape and varies.dtype == bool
    u = sequences.sobol(len(scene.needs)).points(2**8)[:, None, None]
    points = low[None] + u * (high - low)[None]
    half = jnp.where(varies[None], points, (low + 0.5 * (high - low))[None])
    np.testing.assert_array_equal(evaluated(scene, points), evaluated(scene, half))
    time = varies[..., scene.needs.index("time")]
    assert 0 < time.mean() < 0.9
    sky = ~varies[..., 0]
    assert 0.05 < sky.mean() and not time[sky].any()


@pytest.mark.slow
def test_time_matters_around_what_moves_and_its_shadows_only():
    """Brute force says where: the boxes are not much larger."""
    scene = VARYING["pinhole"]()
    low, high = boxes(scene)
    time = scene.needs.index("time")
    varies = np.asarray(varied(scene, low, high))[..., time]
    u = sequences.owen(sequences.sobol(len(scene.needs)), 1).points(2**8)[:, None, None]
    points = low[None] + u * (high - low)[None]
    changes = evaluated(scene, points) != evaluated(scene, points.at[..., time].set(0.5))
    changes = np.asarray(changes.any(axis=(0, -1)))
    assert not (changes & ~varies).any()
    assert varies.sum() < 2.5 * changes.sum()


@pytest.mark.slow
def test_adaptive_images_are_the_same_and_take_fewer_samples():
    """A ball that flies over a plane: what is seen in mirrors has its tests above."""
    ball = tracing.sphere([0, 0, 0], 0.3, motion=motion.affine(None, path([-1, 1, 0], [-0.4, 0.7, 0])))
    plane, lamp = tracing.plane([0, 0, 0], [0, 1, 0]), tracing.point_light([-1, 4, 1], 20.0)
    camera = tracing.camera([0, 1.3, 5], [0, 0.8, 0])
    scene = tracing.direct_light(tracing.world([ball, plane], [lamp]), camera)
    sampler = samplers.independent(sequences.sobol(len(scene.needs)), 3)
    image = qj.render(scene, sampler, SIDE, SIDE, 16)
    adaptive = qj.render_adaptive(scene, sampler, SIDE, SIDE, 16)
    np.testing.assert_allclose(adaptive.image, image, atol=2e-6)
    assert adaptive.saving > 0.2
