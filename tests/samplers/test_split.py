"""Trajectory splitting: coordinates of samplers made for more samples, nets, and images by fewer rays."""

import itertools
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from sampler_tables import MAKERS, owen, tile
from scipy.stats import chi2, norm, t
from tables import few, first, is_net, points_of

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

SIDE, KEYS = 32, 64
FIVE_SIGMA = chi2.isf(norm.sf(5), 9)
STUDENT = t.isf(norm.sf(5), KEYS - 1)


def z(spp):
    return MAKERS["z"](SIDE, spp, 4, 1)


# Samples, sub-samples, dimensions.
WAYS = {
    "contiguous": (2, 3, 4), "z": (4, 4, 4), "z, rounds": (2, 4, 4), "z, counts": (2, 4, 4),
    "independent": (2, 5, 4), "progressive": (2, 4, 6), "dither": (2, 4, 4), "window_lattice": (2, 4, 4),
    "optimized": (2, 8, 2), "optimized, joint": (4, 2, 4), "optimized, frames": (1, 4, 4),
    "designed": (1, 4, 4), "designed, progressive": (1, 4, 4), "designed, frames": (1, 4, 4),
    "tiled, whole": (2, 4, 4), "interleaved, positions": (2, 3, 4), "segments": (2, 3, 3),
    "full_screen": (1, 4, 3), "randomized": (2, 3, 4), "split": (4, 3, 4), "split, designed": (2, 2, 6),
    "ranked": (1, 4, 4),
}  # fmt: skip
RANKED = MAKERS["ranked"]
MORE = {
    "optimized, joint": MAKERS["optimized"],
    "tiled, whole": lambda w, n, d, key: samplers.tiled(tile(w, w, 1, d), key, spp=n),
    "interleaved, positions": lambda _, n, d, k: samplers.interleaved(owen(2, k), n, 2, RANKED(0, 0, 2, k)),
    "randomized": lambda w, n, d, k: samplers.randomized(lambda each: MAKERS["contiguous"](w, n, d, each), k),
    "split": lambda w, n, d, key: MAKERS["contiguous"](w, n, d, key).split((1, 2), 2),
    "split, designed": lambda w, n, d, key: MAKERS["designed"](w, n, d, key).split((2, 3), 2),
}
OWN = [name for name in WAYS if any(word in name for word in ("joint", "d, frames", "designed", "tiled"))]


def made(name, spp, key=1):
    return (MAKERS | MORE)[name](SIDE, spp, WAYS[name][2], key)


@pytest.mark.parametrize("name", few(WAYS, "contiguous", "z", "designed", "split"))
def test_split_coordinates_are_those_of_a_sampler_made_for_so_many_samples_the_others_do_not_change(name):
    """Tiles have translations and turns of their own, and searched maps continue below the samples."""
    spp, count, _ = WAYS[name]
    coarse = made(name, spp)
    # What has been split has twice as many samples already.
    fine = made("contiguous", spp * 2 * count) if name == "split" else made(name, spp * count)
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


@pytest.mark.parametrize("name", few(WAYS, "designed, progressive", "optimized, frames"))
def test_split_and_other_coordinates_are_uniform_together_over_keys_and_independent_in_each_image(name):
    """In 4 x 4 cells of a coordinate or outline each: 5 sigma over keys, and of independent samples."""
    spp, count, _ = WAYS[name]
    dims = made(name, spp).dims
    y, x, s = np.ogrid[:SIDE, :SIDE, : spp * count * (2 if "split" in name else 1)]

    @jax.jit
    @jax.vmap
    def drawn(key):
        split = made(name, spp, key).split(tuple(range(dims // 2, dims)), count)
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


PLAIN = ("progressive", "independent", "ranked")


SPLIT = [("z", 1, 8), ("z", 4, 8), ("contiguous", 2, 4), *((n, 4, 4) for n in PLAIN)]


@pytest.mark.parametrize("name, spp, count", SPLIT)
def test_sub_samples_of_a_sample_of_a_pixel_and_of_squares_of_pixels_are_nets(name, spp, count):
    dims = (2, 3) if name == "z" else (0, 1)
    split = MAKERS[name](SIDE, spp, 4 if name == "z" else 2, 1).split(dims, count)
    for side in (1, 2, 4) if name[0] in "zcp" else (1,):
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
        steps = (lights * times, times, 1)
        camera, light, time = (of[x, y, leaf // step] for of, step in zip(made, steps, strict=True))
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


def shadow(split):
    return lambda: qj.render(scenes.soft_shadow(), z(4), SIDE, SIDE, 4, split=split)


NET = samplers.full_screen(sequences.hammersley_net(10), 16, 16)


SHORT = samplers.contiguous(orders.hilbert(32, 32), sequences.hammersley_net(12), 2)
test_wrong_counts_are_refused = refused(
    (z(4).split, (2,), 3, "count must be a power of two, at most 536870912 for spp=4, got 3"),
    (SHORT.split, (1,), 4, "count must be at most 2 for spp=2, got 4"),
    (NET.split, (1,), 2, "count must be at most 1 for spp=4, got 2"),
    (samplers.designed(8, 8, 2, 1).split, (1,), 3, "count must be a power of two, at most 32768 for spp=2"),
    (z(4).split, (2,), 0, r"count must be an integer in \[1"),
    (z(4).split, (4,), 2, r"dims must be an integer in \[0, 3\], got 4"),
    (shadow({"lamp": 4}), r"split must name dimensions .* \('light_u', 'light_v'\), got 'lamp'"),
    (shadow({"x": 4}), "none of the screen.* got 'x'"),
    (shadow({"light": 4, "light_u": 2}), "each once.* got 'light_u'"),
    (shadow({"light": 0}), r"split must be an integer in \[1"),
    (shadow({"light": 3}), "got 3"),
    (shadow(4), TypeError, "split must be a mapping such as {'light': 4}, got 4"),
    (shadow({"light": 4.0}), TypeError, "split must be an integer"),
    (z(4).split, (2,), 2.0, TypeError, "count must be an integer"),
    error=ValueError,
)
