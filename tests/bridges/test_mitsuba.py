"""Our images against those of Mitsuba 3: two programs that share nothing but the description of a scene."""

import json

import numpy as np
import pytest
from scipy.stats import t as student

import qmcjax as qj
from figures.shared.mitsuba_runs import mitsuba_scenes
from qmcjax import samplers, scenes, sequences, tracing
from qmcjax.tracing import motion

SIDE, REPLICATES = 64, 16

mitsuba = pytest.mark.skipif(not mitsuba_scenes.installed(), reason="Mitsuba is not installed")

FRONT = tracing.camera((0.0, 1.0, 4.4), (0.0, 1.0, 0.0), shutter=0.0)
TURNING = motion.affine(lambda time: motion.quaternion([1.0, 2.0, 0.5], time), [0.2, 0.1, -0.3])
LENS = tracing.camera((0.3, 1.4, 4.4), (0.0, 0.7, 0.0), fov=36.0, shutter=0.5, aperture=0.15, focus=4.0)


def cornell_box(**options):
    return scenes.cornell_box(0.5, ball=False, blocks=True, light=0.5, **options).estimator


def every_part(lights, of_disc):
    """Return a world of one object of each kind, turned and moved, that reflects light several times."""
    first = [[-1.2, 0, 0.8], [-0.6, 0, 0.9], [-0.9, 0.7, 0.7]]
    mesh = [first, [[-0.6, 0, 0.9], [-0.3, 0, 0.3], [-0.9, 0.7, 0.7]]]
    red = {"motion": TURNING, "material": tracing.diffuse((0.8, 0.3, 0.2))}
    round_ones = [tracing.sphere([-0.6, 1.2, -0.5], 0.4)]
    round_ones += [tracing.cylinder([-0.5, 0.4, 0.2], [0.3, 0.3, 0], 0.1)]
    objects = [
        tracing.plane([0, 0, 0], [0.0, 1, 0.05], material=tracing.diffuse((0.5, 0.6, 0.7))),
        tracing.box([0.4, 0.2, -0.5], [1, 0.7, 0.4], **red),
        tracing.group(round_ones, motion=TURNING),
        tracing.disc([0, 0.8, -1.2], [0.2, 0.3, 1], 0.9, material=of_disc),
        tracing.triangles(mesh, material=tracing.diffuse(0.9)),
    ]
    return tracing.world(objects, lights)


POINT = tracing.point_light([1.5, 2.5, 1.0], [3, 4, 5])
SPHERE = tracing.sphere_light([-0.8, 2.0, 0.5], 0.3, [9, 7, 5])

SCENES = {
    "cornell box, direct": lambda: cornell_box(mirror=False),
    "cornell box, 4 bounces": lambda: cornell_box(bounces=4),
    "occluder, direct": lambda: scenes.occluder().estimator,
    "point and sphere light, lens": lambda: seen([POINT, SPHERE], tracing.mirror((0.9, 0.8, 0.6))),
    # Without mirrors: at the last surface of a path Mitsuba's would show the environment.
    "environment": lambda: seen([tracing.environment([0.4, 0.5, 0.6])], tracing.diffuse(0.9)),
}


def seen(*given):
    return tracing.path_tracing(every_part(*given), LENS, 2)


def replicates(scene, spp):
    """Return images by sequences of their own, float64 (REPLICATES, SIDE, SIDE, 3)."""
    sobol = sequences.sobol(len(scene.needs))
    keyed = [samplers.independent(sobol, key) for key in range(REPLICATES)]
    return np.asarray([qj.render(scene, sampler, SIDE, SIDE, spp) for sampler in keyed], np.float64)


def mean_and_variance(images):
    return images.mean(axis=0), images.var(axis=0, ddof=1) / len(images)


@mitsuba
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_same_image(name):
    """Means differ by less than 0.5 %, pixels by less than 5 sigma: the quantile of Welch's t as unlikely."""
    scene = SCENES[name]()
    theirs, _ = mitsuba_scenes.render_image(scene, SIDE, SIDE, 64, list(range(REPLICATES)))
    (ours, our_variance), (theirs, their_variance) = (
        mean_and_variance(images) for images in (replicates(scene, 16), theirs.astype(np.float64))
    )
    assert abs(ours.mean() - theirs.mean()) < 0.005 * theirs.mean()
    for channel in range(3):
        assert abs(ours[..., channel].mean() / theirs[..., channel].mean() - 1) < 0.01
    total = our_variance + their_variance
    known = np.where(total > 0, total, 1)
    freedom = (REPLICATES - 1) * known**2 / np.where(total > 0, our_variance**2 + their_variance**2, 1)
    five = student.isf(5.7e-7 / 2, freedom)
    # Pixels of one colour have no variance, but rounding.
    beyond = abs(ours - theirs) > five * np.sqrt(total) + 1e-5 * theirs
    assert not beyond.any(), np.argwhere(beyond)


def test_what_has_no_counterpart_is_refused():
    """What Mitsuba would make differently raises an error that names it; the rest is JSON."""
    json.dumps(mitsuba_scenes.describe(scenes.occluder().estimator, SIDE, SIDE))
    ball = tracing.sphere([0, 0, 0], 1.0, material=tracing.glossy(0.5, 0.2))
    checked = tracing.sphere([0, 0, 0], 1.0, material=tracing.diffuse(tracing.checker(0, 1)))
    for world, camera, message in (
        (tracing.world([ball]), FRONT, "material"),
        (tracing.world([checked]), FRONT, "colours"),
        (tracing.world([]), tracing.camera([0, 0, 1], [0, 0, 0], aspect=2.0, shutter=0.0), "aspect"),
        (tracing.world([]), tracing.camera([0, 0, 1], [0, 0, 0], aperture=1.0, blades=5), "blades"),
    ):
        with pytest.raises(ValueError, match=message):
            mitsuba_scenes.describe(tracing.direct_light(world, camera), SIDE, SIDE)
    with pytest.raises(ValueError, match="mirrors"):
        mitsuba_scenes.describe(tracing.direct_light(tracing.world([]), FRONT, mirrors=1), SIDE, SIDE)
