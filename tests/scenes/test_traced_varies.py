"""Where traced scenes say that a coordinate does not matter, it does not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import samplers, sequences, tracing
from qmcjax.tracing import motion

pytestmark = pytest.mark.usefixtures("least_optimized")

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
    lamps = [
        tracing.point_light([-1, 4, 1], 20.0),
        tracing.rectangle_light([1, 3, 0], [0.5, 0, 0], [0, 0, 0.5], 20.0),
    ]
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


SCENES = {
    "pinhole": scene,
    "lens": lambda: scene(aperture=0.05, focus=4.0),
    "mirror": chrome,
    "paths": lambda: tracing.path_tracing(*indirect(), 1),
    "bidirectional": lambda: tracing.bidirectional(*indirect(), 1),
}


@jax.jit
def varied(scene, low, high):
    return scene.varies(low, high)


@jax.jit
def evaluated(scene, point):
    return scene(point)


def boxes(scene):
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    low = np.stack([x, y, *[0 * x] * (len(scene.needs) - 2)], axis=-1) / SIDE
    high = low.copy()
    high[..., :2] += 1 / SIDE
    high[..., 2:] = 1
    return jnp.asarray(low, jnp.float32), jnp.asarray(high, jnp.float32)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_what_does_not_vary_does_not_matter(name):
    """Samples in each pixel: those coordinates anywhere, against the same samples with them at 1/2."""
    scene = SCENES[name]()
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
    scene = SCENES["pinhole"]()
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
