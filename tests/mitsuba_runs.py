"""Runs of Mitsuba 3 with samplers of ours, each in a process of its own: ``mitsuba_runs.py RUN``, to JSON."""

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import drjit
import mitsuba as mi
import numpy as np

from qmcjax import orders, samplers, sequences
from qmcjax.bridges import mitsuba as bridge

OWEN = samplers.independent(sequences.sobol(6), 1)
CURVE = samplers.contiguous(orders.hilbert(8, 8), sequences.sobol(2), 4)

PATH = {"type": "path", "max_depth": 4}
ASKED = {"type": "asked"}
WHERE = {"type": "where"}

SIZE = 40, 36


def described(sampler: Any, size, integrator, crop=None, rfilter="box", film=None, plug_in=None):
    """Return a ball below a sky and a lamp, seen with a sampler of ours, or of Mitsuba's by its name."""
    given = {
        "type": "hdrfilm",
        "width": size[0],
        "height": size[1],
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": rfilter},
    } | (film or {})
    if crop:
        names = ("crop_offset_x", "crop_offset_y", "crop_width", "crop_height")
        given |= dict(zip(names, crop, strict=True))
    loaded = mi.load_dict(given)
    sampling = {"type": "qmcjax", "sampler": sampler, "film": loaded} | (plug_in or {})
    if isinstance(sampler, str):
        sampling = {"type": sampler}
    elif hasattr(sampler, "dims"):
        sampling["sampler"] = bridge.held(sampler)
    lamp = {"type": "area", "radiance": {"type": "rgb", "value": [5, 4, 3]}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": integrator,
            "sensor": {
                "type": "perspective",
                "film": loaded,
                "sampler": sampling,
                "to_world": mi.ScalarTransform4f().look_at([0, 1, 4], [0, 0, 0], [0, 1, 0]),
            },
            "ball": {"type": "sphere"},
            "lamp": {"type": "sphere", "center": [1, 2, 1], "radius": 0.5, "emitter": lamp},
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.2, 0.3, 0.4]}},
        }
    )


def image(*scene, spp=4, seed=0, **options):
    return np.array(mi.render(described(*scene, **options), spp=spp, seed=seed), np.float64)


def set_up(variant):
    """Register the plug-in, and integrators that show what it hands out."""
    bridge.register(variant)
    mi.set_log_level(mi.LogLevel.Error)

    class Where(mi.SamplingIntegrator):
        """Shows column, row and number of a sample; in scalar variants."""

        def sample(self, scene, sampler, ray, medium=None, active=True):
            place = sampler.stream.samples.where(np.array([sampler.number], np.uint32))
            return mi.Color3f(*(float(part[0]) for part in place)), True, []

    class Asked(mi.SamplingIntegrator):
        """Shows a single coordinate, the second of a pair, and the first of a pair of padding."""

        def sample(self, scene, sampler, ray, medium=None, active=True):
            values = sampler.next_1d(), sampler.next_2d()[1], sampler.next_2d()[0]
            return mi.Color3f(*values), mi.Bool(True), []

    mi.register_integrator("where", Where)
    mi.register_integrator("asked", Asked)


def places():
    """Return for films of all kinds whether each pixel was told, and the means of the samples' numbers."""
    set_up("scalar_rgb")
    crop = 3, 7, 40, 37
    later = {"first_sample": 10}
    shown = {
        "odd": image(OWEN, (70, 37), WHERE, plug_in=later),
        "crop": image(OWEN, (70, 60), WHERE, crop=crop, plug_in=later),
        "border": image(OWEN, (20, 10), WHERE, film={"sample_border": True}, plug_in=later),
        "a block beyond the edge": image(OWEN, (64, 33), WHERE, plug_in=later),
    } | {
        f"blocks of {side}": image(
            OWEN, (20, 20), WHERE | {"block_size": side}, plug_in=later | {"block_size": side}
        )
        for side in (4, 16)
    }
    found = {}
    for name, values in shown.items():
        left, top, width, height = crop if name == "crop" else (0, 0, *values.shape[1::-1])
        y, x = np.mgrid[top : top + height, left : left + width]
        same = np.array_equal(values[..., 0], x) and np.array_equal(values[..., 1], y)
        found[name] = [same, np.unique(values[..., 2]).tolist()]
    # Neighbours reach into each other's pixels there: what is shown is a mean of theirs.
    blurred = image(OWEN, (24, 20), WHERE, rfilter="gaussian", film={"sample_border": True}, spp=8)
    inside = np.s_[4:-4, 4:-4]
    y, x = np.mgrid[:20, :24]
    off = max(abs(blurred[..., k] - of - 2)[inside].max() for k, of in enumerate((x, y)))
    return found | {"wide filter": [bool(off < 0.5), [11.5]]}


def whole_bytes():
    """Return an image of what is asked for."""
    set_up("scalar_rgb")
    return image(OWEN, SIZE, ASKED, spp=8).tobytes().hex()


def points():
    """Return that image's first two colours, from the sampler itself."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.uint32)
    return np.mean([np.asarray(OWEN(x, y, np.uint32(k), (2, 5)), np.float64) for k in range(8)], axis=0)


def tiles():
    """Return that image from two halves."""
    crops = [(x, 0, SIZE[0] // 2, SIZE[1]) for x in (0, SIZE[0] // 2)]
    return np.concatenate([image(OWEN, SIZE, ASKED, spp=8, crop=crop) for crop in crops], axis=1)


def equal():
    """Return what differs between images that should be equal, and what copies of a plug-in hand out."""
    set_up("scalar_rgb")
    whole = image(OWEN, SIZE, ASKED, spp=8)
    passes = [image(OWEN, SIZE, ASKED, spp=4, plug_in={"first_sample": n}) for n in (0, 4)]
    sampler = described(OWEN, SIZE, ASKED).sensors()[0].sampler()
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
    """Return the messages of what goes wrong."""
    with suppress(ValueError):
        bridge.register()
        return {}
    set_up("scalar_rgb")
    small = (8, 8)
    sampler = described(OWEN, SIZE, ASKED).sensors()[0].sampler()
    sampler.seek(5, 3)
    calls: dict[str, Callable[[], Any]] = {
        "seed": lambda: image(OWEN, SIZE, ASKED, seed=1),
        "passes": lambda: image(OWEN, small, ASKED | {"samples_per_pass": 2}),
        "size": lambda: image(CURVE, (8, 4), ASKED),
        "count": lambda: image(CURVE, small, ASKED, spp=8),
        "nothing": lambda: mi.load_dict({"type": "qmcjax", "sampler": bridge.held(OWEN)}),
        "film": lambda: image(OWEN, small, ASKED, plug_in={"film": 3}),
        "sampler": lambda: image(3, small, ASKED),
        "key": lambda: image(OWEN, small, ASKED, plug_in={"key": -1}),
        "block": lambda: image(OWEN, small, ASKED, plug_in={"block_size": 3}),
        "variant": lambda: bridge.register("scalar_rbg"),
        "no name": lambda: bridge.register(3),  # pyright: ignore[reportArgumentType]
        "held": lambda: bridge.held(sequences.sobol(2)),
        "seek": lambda: sampler.seek(40, 0),
        "beyond": lambda: [[sampler.advance(), sampler.next_1d()] for _ in range(8)],
    }
    found = {}
    for name, call in calls.items():
        try:
            call()
        except Exception as error:
            found[name] = f"{type(error).__name__}: {error}"
    return found


def unbiased(variant):
    """Return how much images with independent samples of ours and of Mitsuba's differ, in standard errors."""
    set_up(variant)
    drjit.set_flag(drjit.JitFlag.SymbolicLoops, False)
    size, count = (12, 12), 24
    sampler_of = [samplers.independent(sequences.sobol(6), key) for key in range(count)]
    ours = [image(of, size, PATH, plug_in={"key": key}) for key, of in enumerate(sampler_of)]
    theirs = [image("independent", size, PATH, seed=seed, spp=16) for seed in range(count)]
    means = [np.mean(images, axis=0) for images in (ours, theirs)]
    variance = sum(np.var(images, axis=0, ddof=1) / count for images in (ours, theirs))
    whole = [np.mean(images, axis=(1, 2, 3)) for images in (ours, theirs)]
    error = np.sqrt(sum(np.var(each, ddof=1) / count for each in whole))
    return {
        "whole": float((np.mean(whole[0]) - np.mean(whole[1])) / error),
        # Without pixels of the sky, which all samples see.
        "square": float(np.mean((means[0] - means[1])[variance > 1e-8] ** 2 / variance[variance > 1e-8])),
    }


def wavefronts():
    """Return the same for arrays, of LLVM."""
    set_up("llvm_ad_rgb")
    found: dict[str, Any] = {}
    try:
        image(OWEN, (8, 6), PATH)
    except Exception as error:
        found["symbolic"] = str(error.__context__ or error)
    drjit.set_flag(drjit.JitFlag.SymbolicLoops, False)
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
    sampler.seed(0, 77)
    with suppress(ValueError):
        sampler.next_1d()
        found["any wavefront"] = True
    for name, call in {
        "sample": lambda: image(CURVE, (8, 8), ASKED, spp=8),
        "seed": lambda: image(OWEN, (8, 8), ASKED, seed=2**30),
    }.items():
        try:
            call()
        except RuntimeError as error:
            found[name] = str(error.__context__ or error.__cause__ or error)
    gradients = {"type": "prb", "max_depth": 4}
    same_seed = [image(OWEN, (8, 6), gradients, seed=seed) for seed in (0, 0, 1)]
    return found | {
        "clone": bool(same),
        "seek": sought == wanted,
        "points": float(abs(whole[..., :2] - points()).max()),
        "passes": float(abs(whole - np.mean(passes, axis=0)).max()),
        "split": float(abs(whole - split).max()),
        "tiles": float(abs(whole - tiles()).max()),
        "image": whole.tolist(),
        "gradients": [bool(np.array_equal(same_seed[0], other)) for other in same_seed[1:]],
    }


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](*sys.argv[2:])))
