"""Trajectory splitting: coordinates of samplers made for more samples, nets, and images by fewer rays."""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2, norm, t
from tables import few, first, is_net, points_of, refuses

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SIDE, KEYS = 32, 64
FIVE_SIGMA = chi2.isf(norm.sf(5), 9)
STUDENT = t.isf(norm.sf(5), KEYS - 1)
IMAGE, CURVE = (SIDE, SIDE), orders.hilbert(SIDE, SIDE)
TILE = np.random.default_rng(1).random((*IMAGE, 1, 4))
MASK = samplers.blue_noise_mask(2)


def owen(dims, key=1):
    return sequences.owen(sequences.sobol(dims), key)


def hilbert(spp, key=1):
    return samplers.contiguous(CURVE, owen(4, key), spp)


def z(spp, key=1):
    return samplers.z(*IMAGE, spp, key, dims=4)


def screen(key):
    return samplers.full_screen(sequences.digital_shift(sequences.sobol(3), key), *IMAGE)


WAYS = {
    "hilbert": (hilbert, 2, 3),
    "z": (z, 4, 4),
    "z, odd": (z, 2, 2),
    "z, rounds": (lambda n, key: z(n, key).extended(2), 2, 4),
    "z, counts": (lambda n, key: z(n, key).adaptive(np.full(IMAGE, n)), 2, 4),
    "independent": (lambda n, key: samplers.independent(sequences.sobol(4), key), 2, 5),
    "progressive": (lambda n, key: samplers.progressive(*IMAGE, key, dims=6), 2, 4),
    "dither": (lambda n, key: samplers.dither(MASK, sequences.rotate(sequences.lattice(4), key)), 2, 4),
    "optimized": (lambda n, key: samplers.optimized(*IMAGE, n, key), 2, 8),
    "optimized, joint": (lambda n, key: samplers.optimized(*IMAGE, n, key, dims=4), 4, 2),
    "optimized, moving": (lambda n, key: samplers.optimized(*IMAGE, n, key, 4, frames=8).at_frame(5), 1, 4),
    "designed": (lambda n, key: samplers.designed(*IMAGE, n, key, 4), 1, 4),
    "designed, progressive": (lambda n, key: samplers.designed(*IMAGE, n, key, 4, progressive=True), 1, 4),
    "designed, frames": (lambda n, key: samplers.designed(*IMAGE, n, key, 4, 8).at_frame(5), 1, 4),
    "tiled": (lambda n, key: samplers.tiled(TILE, key, spp=n), 2, 4),
    "interleaved": (lambda n, key: samplers.interleaved(owen(2, key), n, 2, samplers.ranked(2, key)), 2, 3),
    "segments": (lambda n, key: samplers.segments(CURVE, owen(3, key), n, True), 2, 3),
    "full screen": (lambda n, key: screen(key), 1, 4),
    "randomized": (lambda n, key: samplers.randomized(lambda each: hilbert(n, each), key), 2, 3),
    "split": (lambda n, key: hilbert(n, key).split((1, 2), 2), 4, 3),
    "split, designed": (lambda n, key: samplers.designed(*IMAGE, n, key, 6).split((2, 3), 2), 2, 2),
    "ranked": (lambda n, key: samplers.ranked(4, key), 1, 4),
}
OWN = [name for name in WAYS if any(word in name for word in ("joint", "moving", "designed", "tiled"))]


@pytest.mark.parametrize("name", few(WAYS, "hilbert", "z", "designed", "split"))
def test_split_coordinates_are_those_of_a_sampler_made_for_so_many_samples_the_others_do_not_change(name):
    """Tiles have translations and turns of their own, and searched maps continue below the samples."""
    make, spp, count = WAYS[name]
    coarse = make(spp, 1)
    # What has been split has twice as many samples already.
    fine = hilbert(spp * 2 * count) if name == "split" else make(spp * count, 1)
    kept, dims = (0,), tuple(range(1, coarse.dims))
    split = coarse.split(dims, count)
    x, y, s = first(SIDE)[:, None, None], first(3)[None, :, None], first(spp * count)
    np.testing.assert_array_equal(split(x, y, s, kept), coarse(x, y, s // np.uint32(count), kept))
    same = (split(x, y, s, dims) == fine(x, y, s, dims)).all(axis=-1)
    assert same.mean() < 0.05 if name in OWN else same.all()
    shuffled = split(x, y, s.astype(np.int16), (*dims, 0))
    np.testing.assert_array_equal(shuffled, split(x, y, s, tuple(range(coarse.dims)))[..., [*dims, 0]])


def cells(points):
    """Return the quarter of each coordinate, and of the area of the first pair's outline, of points."""
    parts = [points[..., j] for j in range(points.shape[-1])]
    parts += [abs(2 * points[..., :2] - 1).max(axis=-1) ** 2] if len(parts) > 1 else []
    return [np.minimum((4 * part).astype(int), 3) for part in parts]


@pytest.mark.parametrize("name", few(WAYS, "designed, progressive", "optimized, moving"))
def test_split_and_other_coordinates_are_uniform_together_over_keys_and_independent_in_each_image(name):
    """In 4 x 4 cells of a coordinate or outline each: 5 sigma over keys, and of independent samples."""
    make, spp, count = WAYS[name]
    dims = make(spp, 1).dims
    y, x, s = np.ogrid[:SIDE, :SIDE, : spp * count * (2 if "split" in name else 1)]

    @jax.jit
    @jax.vmap
    def drawn(key):
        split = make(spp, key).split(tuple(range(dims // 2, dims)), count)
        return split(x, y, s, tuple(range(dims)))

    points = np.asarray(drawn(jax.random.split(jax.random.key(1), KEYS))).reshape(KEYS, SIDE**2, s.size, dims)
    # The tile of 16 x 16 pixels occurs four times.
    samples = SIDE**2 * spp // (4 if "progressive" in name and "designed" in name else 1)
    numbers = 16 * np.arange(KEYS * s.size).reshape(KEYS, 1, s.size)
    for one, other in itertools.product(cells(points[..., : dims // 2]), cells(points[..., dims // 2 :])):
        counts = np.bincount((numbers + 4 * one + other).ravel(), minlength=16 * numbers.size)
        shares = counts.reshape(KEYS, s.size, 16) / SIDE**2
        error = shares.std(axis=0, ddof=1) / np.sqrt(KEYS)
        # By translations alone, as many points as a tile has.
        assert name == "ranked" or (abs(shares.mean(axis=0) - 1 / 16) <= STUDENT * error + 1e-9).all()
        image = shares.mean(axis=1).reshape(KEYS, 4, 4)
        expected = image.sum(axis=2, keepdims=True) * image.sum(axis=1, keepdims=True)
        assert (samples * ((image - expected) ** 2 / expected).sum(axis=(1, 2))).max() < FIVE_SIGMA


NETS = {
    "z, 1 sample": (lambda: z(1), 8),
    "z, 4 samples": (lambda: z(4), 8),
    "hilbert, 2 samples": (lambda: hilbert(2), 4),
    "progressive, 4 samples": (lambda: samplers.progressive(*IMAGE, 1), 4),
    "independent, 4 samples": (lambda: samplers.independent(sequences.sobol(2), 1), 4),
    "ranked, 4 samples": (lambda: samplers.ranked(2, 1), 4),
}


@pytest.mark.parametrize("name", NETS)
def test_sub_samples_of_a_sample_of_a_pixel_and_of_squares_of_pixels_are_nets(name):
    make, count = NETS[name]
    sampler, spp = make(), int(name.split()[-2])
    dims = (sampler.dims - 2, sampler.dims - 1) if name[0] == "z" else (0, 1)
    split = sampler.split(dims, count)
    for side in (1, 2, 4) if name[0] in "zhp" else (1,):
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


def test_a_ray_traced_scene_traces_camera_rays_once():
    count, sampler = 4, samplers.independent(sequences.sobol(5), 1)

    def work(split):
        image = partial(qj.render, scenes.occluder(), width=61, height=1, spp=1, split=split)
        return jax.jit(image).lower(sampler).cost_analysis()["flops"]

    assert work({"light": count}) < 0.6 * count * work(None)


@pytest.mark.slow
def test_images_of_a_ray_traced_scene_are_those_of_all_its_samples():
    scene, count = scenes.occluder(), 4
    sampler = samplers.z(8, 8, 4, 1, dims=5)
    image = qj.render(scene, sampler, 8, 8, 4, split={"light": count})
    flat = qj.render(scene, sampler.split((2, 3, 4), count), 8, 8, 4 * count)
    np.testing.assert_allclose(image, flat, atol=1e-6)


def shadow(split, sampler=None):
    return lambda: qj.render(scenes.soft_shadow(), sampler or z(4), SIDE, SIDE, 4, split=split)


NET = samplers.full_screen(sequences.hammersley_net(10), 16, 16)


def short(spp):
    return samplers.contiguous(orders.hilbert(32, 32), sequences.hammersley_net(12), spp)


test_wrong_counts_are_refused = refuses(
    ValueError,
    {
        "count must be a power of two, at most 536870912 for spp=4, got 3": lambda: z(4).split((2,), 3),
        "count must be at most 2 for spp=2, got 4": lambda: short(2).split((1,), 4),
        "count must be at most 1 for spp=4, got 2": lambda: NET.split((1,), 2),
        "count must be a power of two, at most 32768 for spp=2, got 3": lambda: samplers.designed(
            8, 8, 2, 1
        ).split((1,), 3),
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
