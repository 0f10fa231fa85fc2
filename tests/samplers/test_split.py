"""Trajectory splitting: coordinates of samplers made for more samples, nets, and images by fewer rays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import few, first, is_net, points_of, refuses

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.rendering._split import SplitScene

SIDE = 16


def owen(dims):
    return sequences.owen(sequences.sobol(dims), 1)


def hilbert(spp, dims=4):
    return samplers.contiguous(orders.hilbert(SIDE, SIDE), owen(dims), spp)


def z(spp):
    return samplers.z(SIDE, SIDE, spp, 1, dims=4)


def moving(spp):
    return samplers.optimized(SIDE, SIDE, spp, 1, dims=3, frames=8).at_frame(5)


WAYS = {
    "hilbert": (hilbert, 2, 3),
    "z": (z, 4, 4),
    "z, rounds": (lambda spp: z(spp).extended(2), 2, 4),
    "z, counts": (lambda spp: z(spp).adaptive(np.full((SIDE, SIDE), spp)), 2, 4),
    "independent": (lambda spp: samplers.independent(sequences.sobol(4), 1), 2, 5),
    "optimized": (lambda spp: samplers.optimized(SIDE, SIDE, spp, 1), 2, 8),
    "optimized, joint": (lambda spp: samplers.optimized(SIDE, SIDE, spp, 1, dims=4), 4, 2),
    "optimized, moving": (moving, 1, 4),
    "designed": (lambda spp: samplers.designed(SIDE, SIDE, spp, 1, dims=4), 2, 8),
    "designed, progressive": (lambda spp: samplers.designed(SIDE, SIDE, spp, 1, progressive=True), 2, 2),
    "interleaved": (lambda spp: samplers.interleaved(owen(2), spp, 2, samplers.ranked(2, 1)), 2, 3),
    "segments": (lambda spp: samplers.segments(orders.hilbert(SIDE, SIDE), owen(3), spp, True), 2, 3),
    "full screen": (lambda spp: samplers.full_screen(sequences.sobol(3), SIDE, SIDE), 2, 3),
    "randomized": (lambda spp: samplers.randomized(lambda key: hilbert(spp), 1), 2, 3),
    "split": (lambda spp: hilbert(spp).split((1, 2), 2), 4, 3),
}


@pytest.mark.parametrize("name", few(WAYS, "hilbert", "z", "designed", "split"))
def test_split_coordinates_are_those_of_a_sampler_made_for_so_many_samples_the_others_do_not_change(name):
    make, spp, count = WAYS[name]
    coarse = make(spp)
    # What has been split has twice as many samples already.
    fine = hilbert(spp * 2 * count) if name == "split" else make(spp * count)
    kept, dims = (0,), tuple(range(1, coarse.dims))
    split = coarse.split(dims, count)
    x, y, s = first(SIDE)[:, None, None], first(3)[None, :, None], first(spp * count)
    np.testing.assert_array_equal(split(x, y, s, kept), coarse(x, y, s // np.uint32(count), kept))
    np.testing.assert_array_equal(split(x, y, s, dims), fine(x, y, s, dims))
    shuffled = split(x, y, s.astype(np.int16), (*dims, 0))
    np.testing.assert_array_equal(shuffled, split(x, y, s, tuple(range(coarse.dims)))[..., [*dims, 0]])


NETS = {
    "z, 1 sample": (lambda: z(1), 8),
    "z, 4 samples": (lambda: z(4), 8),
    "hilbert, 2 samples": (lambda: hilbert(2), 4),
    "independent, 4 samples": (lambda: samplers.independent(sequences.sobol(2), 1), 4),
}


@pytest.mark.parametrize("name", NETS)
def test_sub_samples_of_a_sample_of_a_pixel_and_of_squares_of_pixels_are_nets(name):
    make, count = NETS[name]
    sampler, spp = make(), int(name.split()[-2])
    dims = (sampler.dims - 2, sampler.dims - 1) if name[0] == "z" else (0, 1)
    split = sampler.split(dims, count)
    for side in (1,) if "independent" in name else (1, 2, 4):
        x, y = (4 + first(side)[:, None, None], 8 + first(side)[None, :, None])
        points = np.asarray(points_of(split, x, y, first(spp * count), dims))
        words = (points * 2.0**32).astype(np.uint32).reshape(-1, spp * count, 2)
        assert is_net(words.reshape(-1, 2), (side**2 * spp * count).bit_length() - 1)
        for pixel in words:
            assert all(is_net(each, count.bit_length() - 1) for each in pixel.reshape(spp, count, 2))


def value(point):
    return point[..., 0] + point[..., 2] * jnp.sin(3 * point[..., 3]) + point[..., 4] * point[..., 1]


SCENE = scenes.function(value, ("x", "y", "light_u", "time", "light_v"))


def test_an_image_is_the_mean_over_a_tree_of_samples():
    spp, lights, times = 2, 3, 2

    def along(n):
        return samplers.contiguous(orders.hilbert(4, 4), owen(5), n)

    where = first(4)[:, None, None], first(4)[None, :, None]
    made = [
        np.asarray(points_of(along(n), *where, first(n), tuple(range(5)), jnp.float32))
        for n in (spp, spp * lights, spp * lights * times)
    ]
    leaves = []
    for y, x, leaf in np.ndindex(4, 4, spp * lights * times):
        camera, light, time = (
            of[x, y, leaf // step] for of, step in zip(made, (lights * times, times, 1), strict=True)
        )
        leaves.append([(x + camera[0]) / 4, (y + camera[1]) / 4, light[2], time[3], light[4]])
    loop = value(np.array(leaves)).reshape(4, 4, -1).mean(axis=2)
    sampler, split = along(spp), {"light": lights, "time": times}
    image = qj.render(SCENE, sampler, 4, 4, spp, split=split)
    np.testing.assert_allclose(image, loop, rtol=1e-6)
    flat = sampler.split((2, 4), lights).split((3,), times)
    np.testing.assert_allclose(image, qj.render(SCENE, flat, 4, 4, spp * lights * times), rtol=1e-6)
    compiled = jax.jit(lambda sampler: qj.render(SCENE, sampler, 4, 4, spp, split=split))
    np.testing.assert_allclose(compiled(sampler), image, rtol=2e-7)  # XLA may fuse other multiply-adds.


def elements(jaxpr, count):
    """Return how many elements the equations make in arrays with an axis of so many."""
    made = 0
    for equation in jaxpr.eqns:
        inner = [part for value in equation.params.values() for part in jax.tree.leaves(value)]
        inner = [
            getattr(part, "jaxpr", part) for part in inner if hasattr(getattr(part, "jaxpr", part), "eqns")
        ]
        made += sum(elements(part, count) for part in inner)
        if not inner:
            made += sum(np.prod(v.aval.shape, dtype=int) for v in equation.outvars if count in v.aval.shape)
    return made


def test_a_ray_traced_scene_traces_camera_rays_once():
    scene, lanes, count = scenes.occluder(), 61, 4
    split = SplitScene(scene, (((0, 1), 1), ((2, 3, 4), count)))
    work = [
        elements(jax.make_jaxpr(of)(jnp.zeros((lanes, len(of.needs)))).jaxpr, lanes) for of in (scene, split)
    ]
    assert work[1] < 0.6 * count * work[0]


@pytest.mark.slow
def test_images_of_a_ray_traced_scene_are_those_of_all_its_samples():
    scene, count = scenes.occluder(), 4
    sampler = samplers.z(8, 8, 4, 1, dims=5)
    image = qj.render(scene, sampler, 8, 8, 4, split={"light": count})
    flat = qj.render(scene, sampler.split((2, 3, 4), count), 8, 8, 4 * count)
    np.testing.assert_allclose(image, flat, atol=1e-6)


def test_images_are_unbiased():
    scene, keys = scenes.soft_shadow(light=(3.0, 3.0)), 256

    @jax.jit
    def image(key):
        scrambled = sequences.owen(sequences.sobol(4), key)
        sampler = samplers.contiguous(orders.hilbert(4, 4), scrambled, 2)
        return qj.render(scene, sampler, 4, 4, 2, split={"light": 3})

    images = np.asarray(jax.vmap(image)(jax.random.split(jax.random.key(1), keys)), np.float64)
    error = images.mean(axis=0) - scene.reference(4, 4)[0]
    assert (abs(error) <= 5 * images.std(axis=0) / np.sqrt(keys) + 1e-6).all()


def shadow(split, sampler=None):
    return lambda: qj.render(scenes.soft_shadow(), sampler or z(4), SIDE, SIDE, 4, split=split)


NET = samplers.full_screen(sequences.hammersley_net(10), SIDE, SIDE)


def short(spp):
    return samplers.contiguous(orders.hilbert(32, 32), sequences.hammersley_net(12), spp)


TILES = samplers.tiled(np.full((4, 4, 1, 2), 0.5), 1)
test_wrong_counts_are_refused = refuses(
    ValueError,
    {
        "count must be a power of two, at most 536870912 for spp=4, got 3": lambda: z(4).split((2,), 3),
        "count must be at most 2 for 4096 indices and spp=2, got 4": lambda: short(2).split((1,), 4),
        "count must be at most 1 for a net, which has 4 points": lambda: NET.split((1,), 2),
        "count must be 1, .* no other tile for spp=1, got 4": lambda: TILES.split((1,), 4),
        "powers of two up to 16 for spp=4, got 8": lambda: samplers.designed(8, 8, 4, 1).split((1,), 8),
        "count must be an integer in \\[1": lambda: z(4).split((2,), 0),
        "dims must be an integer in \\[0, 3\\], got 4": lambda: z(4).split((4,), 2),
        "split must name dimensions .* \\('light_u', 'light_v'\\), got 'lamp'": shadow({"lamp": 4}),
        "none of the screen.* got 'x'": shadow({"x": 4}),
        "each once.* got 'light_u'": shadow({"light": 4, "light_u": 2}),
        "split must be an integer in \\[1": shadow({"light": 0}),
        "got 3": shadow({"light": 3}),
    },
)
test_wrong_types_are_refused = refuses(
    TypeError,
    {
        "split must be a mapping such as {'light': 4}, got 4": shadow(4),
        "split must be an integer": shadow({"light": 4.0}),
        "count must be an integer": lambda: z(4).split((2,), 2.0),
    },
)
