"""Runs of Mitsuba 3 with samplers of ours, each in a process of its own: ``mitsuba_runs.py RUN``, to JSON."""

import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import drjit
import jax
import jax.numpy as jnp
import mitsuba as mi
import numpy as np
import tables

from qmcjax import orders, samplers, sequences
from qmcjax.bridges import mitsuba as bridge
from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.bridges._source import read
from qmcjax.bridges.mitsuba._evaluated import Arrays, Evaluated
from qmcjax.bridges.mitsuba._given import Window
from qmcjax.bridges.mitsuba._scalar import block_side, blocks

OWEN = samplers.independent(sequences.sobol(6), 1)
CURVE = samplers.contiguous(orders.hilbert(8, 8), sequences.sobol(2), 4)

PATH = {"type": "path", "max_depth": 4}
ASKED = {"type": "asked"}

SIZE = 40, 36


def described(sampler: Any, size, integrator, crop=None, rfilter="box", film=None, plug_in=None, sensor=None):
    """Return a ball below a sky and a lamp, seen with a sampler of ours, or of Mitsuba's by its name."""
    given = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": rfilter}}
    given |= {"pixel_format": "rgb", "component_format": "float32"} | (film or {})
    if crop:
        names = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")
        given |= dict(zip(names, crop, strict=True))
    loaded = mi.load_dict(given)
    sampling = {"type": "qmcjax", "sampler": sampler, "film": loaded} | (plug_in or {})
    if isinstance(sampler, str):
        sampling = {"type": sampler}
    elif hasattr(sampler, "dims"):
        sampling["sampler"] = bridge.wrap(sampler)
    lamp = {"type": "area", "radiance": {"type": "rgb", "value": [5, 4, 3]}}
    seen = {"type": "perspective", "film": loaded, "sampler": sampling}
    seen["to_world"] = mi.ScalarTransform4f().look_at([0, 1, 4], [0, 0, 0], [0, 1, 0])
    scene = {
        "ball": {"type": "sphere"},
        "lamp": {"type": "sphere", "center": [1, 2, 1], "radius": 0.5, "emitter": lamp},
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.3, 0.4]}},
    }
    scene |= {"type": "scene", "integrator": integrator, "sensor": seen | (sensor or {})}
    return mi.load_dict(scene)


def image(*scene, spp=4, seed=0, **options):
    return np.array(mi.render(described(*scene, **options), spp=spp, seed=seed), np.float64)


def set_up(variant):
    """Register the plug-in, and an integrator that shows what it hands out."""
    bridge.register(variant)
    mi.set_log_level(mi.LogLevel.Error)

    class Asked(mi.SamplingIntegrator):
        """Shows a single coordinate, the second of a pair, and the first of a pair of padding."""

        def sample(self, scene, sampler, ray, medium=None, active=True):
            values = sampler.next_1d(), sampler.next_2d()[1], sampler.next_2d()[0]
            return mi.Color3f(*values), mi.Bool(True), []

    mi.register_integrator("asked", Asked)


def whole_bytes():
    """Return an image of what is asked for."""
    set_up("scalar_rgb")
    return image(OWEN, SIZE, ASKED, spp=8).tobytes().hex()


def points():
    """Return that image's first two colours, from the sampler itself."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.uint32)
    return np.mean([np.asarray(OWEN(x, y, np.uint32(k), (2, 5)), np.float64) for k in range(8)], axis=0)


def numbered():
    """Return a sampler of which the integrator shows column, row and sample, over 256."""

    def points(x, y, sample):
        column, row, number = (word.astype(jnp.float32) / 256 for word in (x, y, sample))
        half = jnp.full_like(column, 0.5)
        return jnp.stack([half, half, column, half, half, row, number, half], -1)

    return samplers.function(points, 8)


def tiles():
    """Return that image from two halves."""
    crops = [(x, 0, SIZE[0] // 2, SIZE[1]) for x in (0, SIZE[0] // 2)]
    return np.concatenate([image(OWEN, SIZE, ASKED, spp=8, crop=crop) for crop in crops], axis=1)


def equal():
    """Return what differs between images that should be equal, and what copies of a plug-in hand out."""
    set_up("scalar_rgb")
    whole = image(OWEN, SIZE, ASKED, spp=8)
    passes = [image(OWEN, SIZE, ASKED, spp=4, plug_in={"first_sample": n}) for n in (0, 4)]
    sensor = described(OWEN, SIZE, ASKED).sensors()[0]
    sensor.film().prepare([])
    sampler = sensor.sampler()
    sampler.seed(11)
    before = [sampler.next_1d(), *sampler.next_2d()]
    copy, forked = sampler.clone(), sampler.fork()
    forked.seed(11)
    after = [[one.next_1d(), *one.next_2d(), *one.next_2d()] for one in (sampler, copy)]
    sampler.set_sample_count(8)
    sampler.seek(5, 3, 6)
    sought = [sampler.next_1d()]
    sampler.advance()
    sought += [sampler.next_1d()]
    return {
        "points": float(abs(whole[..., :2] - points()).max()),
        "passes": float(abs(whole - np.mean(passes, axis=0)).max()),
        "tiles": float(abs(whole - tiles()).max()),
        "bytes": whole.tobytes().hex(),
        "clone": after[0] == after[1] and len({*before, *after[0]}) == 8,
        "fork": [forked.next_1d(), *forked.next_2d()] == before,
        "seek": sought == [float(OWEN(5, 3, k, (0,))[0]) for k in (6, 7)],
    }


def refused():
    """Check messages of what goes wrong."""
    refuse({"variant must be one of": bridge.register})
    set_up("scalar_rgb")
    small = (8, 8)
    asked = partial(image, OWEN, small, ASKED)
    sampler = described(OWEN, SIZE, ASKED).sensors()[0].sampler()
    sampler.seek(5, 3)
    calls: dict[str, Callable[[], Any]] = {
        "seed must be 0 in scalar variants": lambda: image(OWEN, SIZE, ASKED, seed=1),
        "samples_per_pass unset": lambda: image(OWEN, small, ASKED | {"samples_per_pass": 2}),
        "width, height must be the sampler's 8 x 8, got 8 x 4": lambda: image(CURVE, (8, 4), ASKED),
        "spp must be at most 4 samples in the block of a": lambda: image(CURVE, small, ASKED, spp=8),
        "film must be a parameter": lambda: mi.load_dict({"type": "qmcjax", "sampler": bridge.wrap(OWEN)}),
        "TypeError: film must be the sensor's film, got 3": lambda: asked(plug_in={"film": 3}),
        "TypeError: sampler must be made by qmcjax.bridges.mitsuba.wrap": lambda: image(3, small, ASKED),
        "key must be an integer": lambda: asked(plug_in={"key": -1}),
        "block_size must be a power of two, got 3": lambda: asked(plug_in={"block_size": 3}),
        "ValueError: variant must be one of": lambda: bridge.register("scalar_rbg"),
        "TypeError: sampler must be a sampler": lambda: bridge.wrap(sequences.sobol(2)),
        "ValueError: x must be an integer in [0, 39], got 40": lambda: sampler.seek(40, 0),
        "number of samples taken, got 4": lambda: [[sampler.advance(), sampler.next_1d()] for _ in range(8)],
    }
    refuse(calls)


def refuse(calls: dict[str, Callable[[], Any]]) -> None:
    """Check that each call raises an error with some words."""
    for words, call in calls.items():
        try:
            call()
        except Exception as error:
            assert words in f"{type(error).__name__}: {error}", error
        else:
            raise AssertionError(words)


INTEGRATORS = {name: PATH | {"type": name} for name in ("path", "prb", "volpath", "prbvolpath", "ptracer")}
INTEGRATORS["aov"] = {"type": "aov", "aovs": "depth:depth", "image": PATH}


def unbiased(variant, integrator="path"):
    """Return how much images with independent samples of ours and of Mitsuba's differ, in standard errors."""
    set_up(variant)
    size, count, kind = (12, 12), 24, INTEGRATORS[integrator]
    sampler_of = [samplers.independent(sequences.sobol(6), key) for key in range(count)]
    ours = [image(of, size, kind, plug_in={"key": key}) for key, of in enumerate(sampler_of)]
    theirs = [image("independent", size, kind, seed=seed, spp=16) for seed in range(count)]
    means = [np.mean(images, axis=0) for images in (ours, theirs)]
    variance = sum(np.var(images, axis=0, ddof=1) / count for images in (ours, theirs))
    whole = [np.mean(images, axis=(1, 2, 3)) for images in (ours, theirs)]
    error = np.sqrt(sum(np.var(each, ddof=1) / count for each in whole))
    return {
        "whole": float((np.mean(whole[0]) - np.mean(whole[1])) / error),
        # Without pixels of the sky, which all samples see.
        "square": float(np.mean((means[0] - means[1])[variance > 1e-8] ** 2 / variance[variance > 1e-8])),
    }


def bits():
    """Return for the samplers of all tests whether arrays of Dr.Jit have the same bits."""
    set_up("llvm_ad_rgb")
    arrays, rng, word = Arrays(drjit, mi.Float), np.random.default_rng(5), jax.ShapeDtypeStruct((), np.uint32)
    found = {}
    for name, sampler in tables.SAMPLERS.items():
        x, y, k = (rng.integers(0, min(end, 32), 4096, np.uint32) for end in sampler.fits.limits)
        dims = tuple(range(sampler.dims))
        program = read(partial(sampler, dims=dims, dtype=jnp.float32), word, word, word)
        ours = Evaluated(arrays, program, {})([arrays.uint(each) for each in (x, y, k)])
        wanted = np.asarray(sampler(x, y, k, dims, jnp.float32)).T
        found[name] = [bool(np.all(np.array(each) == of)) for each, of in zip(ours, wanted, strict=True)]
    return found


def scalar_bits():
    """Return for the samplers of all tests whether the plug-in returns their pairs, and one more."""
    set_up("scalar_rgb")
    side, words = tables.SIDE, jax.random.bits(jax.random.key(0), (2,), jnp.uint32)
    x, y = (np.array(each, np.uint32) for each in ([0, 5, 3], [0, 2, side - 1]))
    # Blocks are halved until there is one for each thread.
    window = Window(side, side, 0, 0)
    block = block_side(window, drjit.thread_count() + 1, 0)
    number = {tuple(corner): k for k, corner in enumerate(blocks(mi.Spiral, window, block).corners.tolist())}
    found = {}
    for name, sampler in tables.SAMPLERS.items():
        if sampler.dims < 2:
            continue
        count = min(4, sampler.fits.spp)
        root = described(sampler, (side, side), ASKED).sensors()[0].sampler()
        root.set_sample_count(count)
        root.given.film.prepare([])
        forked = root.fork()
        pairs = sampler.dims // 2
        values = []
        for column, row in zip(x.tolist(), y.tolist(), strict=True):
            corner = number[column // block * block, row // block * block]
            within = int(orders.morton(block, block).position(column % block, row % block))
            forked.seed(corner * block**2 + within)
            for _ in range(count):
                values += [[np.array(forked.next_2d()).tolist() for _ in range(pairs + 1)]]
                forked.advance()
        where = [np.repeat(each, count) for each in (x, y)]
        sample = np.tile(np.arange(count, dtype=np.uint32), len(x))
        own = np.asarray(sampler(*where, sample, tuple(range(2 * pairs)))).reshape(-1, pairs, 2)
        pixel = padding_pixel(words, *map(jnp.asarray, where))
        more = np.asarray(padding_pair(pixel, jnp.uint32(pairs), jnp.asarray(sample)))
        wanted = np.concatenate([own, more[:, None]], axis=1)
        found[name] = bool(np.array_equal(np.array(values, np.float32), wanted))
    return found


def replaced(variant):
    """Return how much images of loaded scenes differ from those of scenes described with the plugin."""
    set_up(variant)
    size, found = (24, 20), {}
    kinds: dict[str, dict[str, Any]] = {
        "perspective": {},
        "crop": {"crop": (3, 7, 15, 11)},
        "border": {"film": {"sample_border": True}, "rfilter": "gaussian"},
        "lens": {"sensor": {"type": "thinlens", "aperture_radius": 0.3, "focus_distance": 4.0}},
        "parallel": {"sensor": {"type": "orthographic"}},
        "fog": {"sensor": {"medium": {"type": "homogeneous", "albedo": 0.8, "sigma_t": 0.1}}},
    }
    for name, options in kinds.items():
        integrator = {"type": "volpath" if name == "fog" else "path", "max_depth": 4}
        for seed in (0, 2):
            described_with = image(OWEN, size, integrator, plug_in={"first_sample": 4 * seed}, **options)
            scene = described("independent", size, integrator, **options)
            ours = np.array(bridge.render(scene, OWEN, spp=4, seed=seed))
            found[f"{name}, {seed}"] = float(abs(ours - described_with).max())
    return found


def production(variant):
    """Return images of all scenes in files, and the size of their crop windows."""
    set_up(variant)
    found = {}
    for path in sorted((Path(__file__).parent / "mitsuba_scenes").glob("*.xml")):
        scene = mi.load_file(str(path))
        size = np.array(scene.sensors()[0].film().crop_size())[::-1]
        found[path.stem] = [size.tolist(), np.array(bridge.render(scene, OWEN, spp=8)).tolist()]
    return found


FILE = """
<scene version="3.0.0">
    <default name="width" value="20"/>
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="$width"/><integer name="height" value="16"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent"><integer name="sample_count" value="2"/></sampler>
    </sensor>
    <sensor type="orthographic"/>
    <shape type="sphere"/>
    <emitter type="constant"/>
</scene>
"""


def files(variant, folder):
    """Return what becomes of scenes in files, and check messages of what goes wrong."""
    set_up(variant)
    path = Path(folder) / "scene.xml"
    path.write_text(FILE, encoding="utf-8")
    scene = mi.load_file(str(path), width=12)
    sizes = []

    def make(width, height, spp):
        sizes.append([width, height, spp])
        return OWEN

    sensor = bridge.sensor_with(scene, OWEN)
    half = mi.load_dict({"type": "hdrfilm", "width": 6, "height": 8, "rfilter": {"type": "box"}})
    smaller = mi.render(scene, sensor=bridge.sensor_with(scene, OWEN, film=half), spp=16)
    means = np.array(mi.render(scene, sensor=sensor, spp=16)).reshape(8, 2, 6, 2, -1).mean(axis=(1, 3))
    theirs = mi.load_dict({"type": "independent"})
    same = [
        np.array_equal(bridge.render(scene, theirs, spp=2, seed=3), mi.render(scene, spp=2, seed=3)),
        np.array_equal(bridge.render(str(path), OWEN), bridge.render(path, make, spp=2)),
    ]
    empty = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
    render = partial(bridge.render, scene, OWEN)
    calls: dict[str, Callable[[], Any]] = {
        "ValueError: scene must be the path of a file": lambda: bridge.render(f"{folder}/none.xml", OWEN),
        "ValueError: scene must have a sensor, got one without": lambda: bridge.render(empty, OWEN),
        "ValueError: sensor must be an integer in [0, 1], got 2": lambda: render(sensor=2),
        "ValueError: spp must be an integer in [1, 4294967295], got 0": lambda: render(spp=0),
        "ValueError: seed must be an integer in [0, 4294967295], got -1": lambda: render(seed=-1),
        "TypeError: sampler must be a sampler": lambda: bridge.render(scene, sequences.sobol(2)),
        "TypeError: film must be a film of the current": lambda: bridge.sensor_with(scene, OWEN, film=3),
    }
    refuse(calls)
    return {
        "sizes": sizes,
        "same": same,
        "half": float(abs(np.array(smaller) - means).mean() / means.mean()),
        "printed": str(sensor),
    }


def in_loops():
    """Return whether pairs are the sampler's, and then those beyond, whose number varies in a loop."""
    set_up("llvm_ad_rgb")
    sampler = described(OWEN, SIZE, ASKED).sensors()[0].sampler()
    x, y, rounds = (np.array(each, np.uint32) for each in ([3, 39, 0, 7], [5, 35, 1, 7], [1, 2, 3, 5]))
    found = {}
    for mode in ("symbolic", "evaluated"):
        sampler.seek(mi.UInt(x), mi.UInt(y), 7)
        first = np.array(sampler.next_2d())

        def body(k, sums, sampler):
            single, both = sampler.next_1d(), sampler.next_2d()
            return k + 1, [sums[0] + single, *(sums[n + 1] + both[n] for n in range(2))], sampler

        start = mi.UInt(0), [mi.Float(0), mi.Float(0), mi.Float(0)], sampler
        _, sums, after = drjit.while_loop(start, lambda k, _, __: k < mi.UInt(rounds), body, mode=mode)
        last = np.array(after.next_2d())
        found[mode] = [first.tolist(), np.array(sums).tolist(), last.tolist()]
    sampler.seek(mi.UInt(x), mi.UInt(y), 7)
    sampler.next_1d()
    # In some lanes two pairs are not taken.
    taken = mi.Bool(rounds > 2)
    ways = (lambda s: (s.next_1d() + s.next_1d(), s)), (lambda s: (mi.Float(0), s))
    _, sampler = drjit.if_stmt((sampler,), taken, *ways, mode="symbolic")
    branch = np.array(sampler.next_2d()).T.tolist()
    words = jax.random.bits(jax.random.key(0), (2,), jnp.uint32)

    def pair(lane, number):
        at = x[lane], y[lane], np.uint32(7)
        if number < 3:
            return np.asarray(OWEN(*at, (2 * number, 2 * number + 1)))
        pixel = padding_pixel(words, *map(jnp.asarray, at[:2]))
        return np.asarray(padding_pair(pixel, jnp.uint32(number), at[2]))

    wanted = [[], [], []]
    for lane, count in enumerate(rounds):
        sums = np.zeros(3, np.float32)
        for k in range(count):
            sums += np.array([pair(lane, 2 * k + 1)[0], *pair(lane, 2 * k + 2)])
        for kept, values in zip(wanted, (pair(lane, 0), sums, pair(lane, 2 * count + 1)), strict=True):
            kept.append(values.tolist())
    branches = [pair(lane, 3 if count > 2 else 1).tolist() for lane, count in enumerate(rounds)]
    return {"branches": [branch == branches]} | {
        mode: [np.array_equal(np.transpose(w), g) for w, g in zip(wanted, of, strict=True)]
        for mode, of in found.items()
    }


def shown(variant):
    """Return for films of all kinds whether pixels are the film's, and the mean of the samples' numbers."""
    set_up(variant)
    crop = 3, 7, 40, 37
    later = {"plug_in": {"first_sample": 10}}
    images = {
        "odd": image(numbered(), (70, 37), ASKED, **later),
        "crop": image(numbered(), (70, 60), ASKED, crop=crop, **later),
        "border": image(numbered(), (20, 10), ASKED, film={"sample_border": True}, **later),
        "a block beyond the edge": image(numbered(), (64, 33), ASKED, **later),
    }
    if variant == "scalar_rgb":
        for blocks in ({"block_size": 4}, {"block_size": 16}):
            how = {"plug_in": later["plug_in"] | blocks}
            images[f"blocks of {blocks['block_size']}"] = image(numbered(), (20, 20), ASKED | blocks, **how)
    else:
        images["passes"] = image(numbered(), (20, 10), ASKED | {"samples_per_pass": 2}, **later)
        images["seed"] = image(numbered(), (20, 10), ASKED, seed=3)
    found = {}
    for name, values in images.items():
        left, top, width, height = crop if name == "crop" else (0, 0, *values.shape[1::-1])
        y, x = np.mgrid[top : top + height, left : left + width]
        columns, rows, numbers = (values[..., k] * 256 for k in range(3))
        found[name] = [bool(abs(columns - x).max() + abs(rows - y).max() < 1e-3), float(numbers.mean())]
    # Neighbours reach into each other's pixels there: what is shown is a mean of theirs.
    wide = {"rfilter": "gaussian", "film": {"sample_border": True}}
    blurred = 256 * image(numbered(), (24, 20), ASKED, spp=8, **wide)
    inside = np.s_[4:-4, 4:-4]
    y, x = np.mgrid[:20, :24]
    off = max(abs(blurred[..., k] - of - 2)[inside].max() for k, of in enumerate((x, y)))
    return found | {"wide filter": [bool(off < 0.5), 11.5]}


def wavefronts():
    """Return what differs between images of LLVM that should be equal, and what is refused."""
    set_up("llvm_ad_rgb")
    whole = image(OWEN, SIZE, ASKED, spp=8)
    scene = described(OWEN, SIZE, ASKED)
    passes = [np.array(mi.render(scene, spp=4, seed=seed), np.float64) for seed in (0, 1)]
    split = image(OWEN, SIZE, ASKED | {"samples_per_pass": 2}, spp=8)
    image(CURVE, (8, 8), ASKED | {"samples_per_pass": 2})
    sampler = scene.sensors()[0].sampler()
    sampler.seek(mi.UInt([3, 39]), mi.UInt([5, 35]), 7)
    sought = [np.array(sampler.next_1d()).tolist()]
    copy = sampler.clone()
    same = np.array_equal(copy.next_2d(), sampler.next_2d())
    sampler.advance()
    sought += [np.array(sampler.next_1d()).tolist()]
    wanted = [[float(OWEN(x, y, k, (0,))[0]) for x, y in ((3, 5), (39, 35))] for k in (7, 8)]
    other = mi.load_dict({"type": "hdrfilm", "width": 8, "height": 8})
    small = (8, 8)
    by_numpy = samplers.function(lambda x, y, sample: np.stack([x, y], -1), 2)
    calls: dict[str, Callable[[], Any]] = {
        "sample": lambda: image(CURVE, small, ASKED, spp=8),
        "seed": lambda: image(CURVE, small, ASKED, seed=1),
        "film": lambda: image(OWEN, small, ASKED, plug_in={"film": other}),
        "size": lambda: image(OWEN, (6, 6), ASKED, plug_in={"film": other}),
        "wavefront": lambda: [sampler.seed(0, 77), sampler.next_1d()],
        "NumPy": lambda: image(by_numpy, small, ASKED),
    }
    found: dict[str, Any] = {}
    for name, call in calls.items():
        try:
            call()
        except (RuntimeError, ValueError) as error:
            found[name] = str(error.__context__ or error.__cause__ or error)
    return found | {
        "clone": bool(same),
        "seek": sought == wanted,
        "points": float(abs(whole[..., :2] - points()).max()),
        "passes": float(abs(whole - np.mean(passes, axis=0)).max()),
        "split": float(abs(whole - split).max()),
        "tiles": float(abs(whole - tiles()).max()),
        "image": whole.tolist(),
    }


def gradients():
    """Return derivatives of the mean by the sky's red, and differences of images, by seeds."""
    set_up("llvm_ad_rgb")
    scene = described(OWEN, (16, 12), INTEGRATORS["prb"])
    parameters = mi.traverse(scene)
    key, found = "sky.radiance.value", []
    for seed in range(8):
        values = []
        for red in (0.2, 0.7):
            parameters[key] = mi.Color3f(red, 0.3, 0.4)
            parameters.update()
            values.append(float(np.array(mi.render(scene, spp=16, seed=seed))[..., 0].mean()))
        drjit.enable_grad(parameters[key])
        parameters.update()
        drjit.backward(drjit.mean(mi.render(scene, parameters, spp=16, seed=seed)[..., 0], axis=None))
        found.append([(values[1] - values[0]) / 0.5, float(drjit.grad(parameters[key])[0][0])])
        drjit.disable_grad(parameters[key])
    return found


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](*sys.argv[2:])))
