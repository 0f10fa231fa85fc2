"""Rendering an image from a scene and a sampler."""

import os
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh
from jax.typing import DTypeLike

from qmcjax.core import backends, checkpoints, checks, devices
from qmcjax.core.checkpoints import Checkpoint
from qmcjax.core.pytrees import jit
from qmcjax.rendering import _accumulation, _scene_program
from qmcjax.rendering._task import Task, check_progress, in_one_pass, open_checkpoint, refuse, task
from qmcjax.samplers import SamplerLike
from qmcjax.scenes import Scene


def render(
    scene: Scene,
    sampler: SamplerLike,
    width: int,
    height: int,
    spp: int,
    *,
    split: Mapping[str, int] | None = None,
    dtype: DTypeLike = jnp.float32,
    progress: Callable[[float], None] | None = None,
    checkpoint: str | os.PathLike[str] | Checkpoint | None = None,
    mesh: Mesh | None = None,
) -> Array:
    """Average the samples of each pixel (box filter).

    Memory is proportional to the number of pixels and does not depend on the number of samples, even for
    gradients with respect to the parameters of the scene.

    Parameters
    ----------
    scene : Scene
        A function from points, shape (..., len(scene.needs)), to values, shape (...) or (..., 3).
    sampler : Sampler
        A function from pixel and sample to a point, made for this image size, with at least
        ``len(scene.needs)`` dimensions.
    width, height : int, in [1, 65536]
    spp : int, samples per pixel, at least 1 and at most as many as the sampler has
    split : mapping from names to int, optional
        How many sub-samples each sample has in the named dimensions, by ``sampler.split``: with ``{"light":
        4}``, four each in ``light``, ``light_u`` and ``light_v``, for one camera ray. Ray-traced scenes
        evaluate what does not depend on these once, others the whole scene. A second name splits each
        sub-sample of the first.
    dtype : float32 or float64
        Dtype of points, values and sums. Sums are compensated: they are as accurate as the values.
    progress : callable, optional
        Called with the finished part in (0, 1], several times in a long run; not inside ``jax.jit``.
    checkpoint : path or Checkpoint, optional
        File that keeps finished work, written every 30 seconds, at the end, and before Ctrl-C or SIGTERM take
        effect. Calling the function again resumes from it, with bit-identical results. The file is not
        deleted. With your own code, such as a scene, pass a :class:`qmcjax.Checkpoint` with a label. Not
        inside ``jax.jit``.
    mesh : jax.sharding.Mesh, optional
        Devices that share the pixels, such as ``jax.make_mesh((jax.device_count(),), ("devices",))``: of one
        process, or of several that all make the same call. Image and derivatives are bit-identical on any
        number of devices, and complete in each process. By default the default device of JAX, where
        ray-traced scenes are compiled alone: last bits may differ from those in another program.

    Returns
    -------
    Array of ``dtype``, shape (height, width) or (height, width, 3)
        ``image[y, x]`` is pixel (x, y), which covers [x, x+1)/width times [y, y+1)/height of the unit square.

    Raises
    ------
    ValueError
        If the scene returns NaN or infinity; the message names the pixel, the sample and the point. If
        ``checkpoint`` is damaged, lacks a label, or belongs to another scene, sampler, size, dtype, label,
        version or flag of JAX.
    OSError
        If ``checkpoint`` cannot be written at the start. Later failures emit a RuntimeWarning.

    Examples
    --------
    >>> from qmcjax import orders, render, samplers, scenes, sequences
    >>> sampler = samplers.contiguous(orders.hilbert(64, 64), sequences.sobol(2), spp=16)
    >>> print(render(scenes.checkerboard(), sampler, 64, 64, spp=16).shape)
    (64, 64)
    """
    wanted = task(scene, sampler, width, height, spp, dtype, split)
    check_progress(progress, wanted)
    mesh = devices.validate_mesh(mesh)
    return render_task(wanted, mesh, progress, open_checkpoint(checkpoint, "render", wanted, mesh))


def render_task(
    task: Task, mesh: Mesh | None, progress: Callable[[float], None] | None, saved: checkpoints.File | None
) -> Array:
    """Take all samples of all pixels of a checked task, resuming from its checkpoint."""
    scene, sampler, width, height, spp, dtype, levels = task
    sampler, dims = sampler.up_to(spp), tuple(range(len(scene.needs)))
    traced, backend = task.traced, backends.current()
    alone = mesh is None and saved is None and _scene_program.suits(task)
    with checks.precision(dtype):
        # Add values pairwise before the compensated sum: memory traffic dominates.
        batch, together = in_one_pass(scene, sampler, spp, dims, levels)
        pixels, size = width * height, _accumulation.tile_size(width * height, together, mesh, traced)
        if backend.caches and size < pixels and not alone:
            sampler = _with_tables(sampler, dims)
        pair = devices.place((scene, sampler), mesh)
        most = min(backend.pixels, backend.samples // spp)
        at_a_time = pixels if traced else max(most // size, devices.count(mesh))
        whole = together > 1 and batch * together == spp
        how = _accumulation.How(size, width, height, batch, together, whole, dims, dtype, mesh, levels)
        count = -(-pixels // size)
        if alone:
            means = _scene_program.means(task, sampler, progress)
            image, finite = _in_place(means, (height, width, *means.shape[1:]), backend.caches)
        elif saved is None and (traced or (count <= at_a_time and count * size * spp <= backend.samples)):
            by_rows = backend.caches and not traced
            made = _at_once(pair, *devices.place((np.uint32(spp),), mesh), how, traced, by_rows)
            image, finite = devices.local(made, mesh)
            if progress is not None:
                jax.block_until_ready(image)
                progress(1.0)
        else:
            with saved or nullcontext():
                image, finite = _in_calls(pair, spp, how, at_a_time, progress, saved)
    if not isinstance(finite, Tracer) and not finite:
        refuse(task, image)
    return image


@jit("dims")
def _with_tables(sampler: Any, dims: tuple[int, ...]) -> Any:
    return sampler.with_tables(dims)


@jit("how", "traced", "by_rows")
def _at_once(
    pair: tuple[Any, Any], spp: Array, how: _accumulation.How, traced: bool, by_rows: bool
) -> tuple[Array, Array]:
    """Return the image and whether it is finite, by one program, since each start takes time."""
    pixels = how.width * how.height
    tiles = jnp.arange(-(-pixels // how.size), dtype=jnp.uint32) * np.uint32(how.size)
    mapped = devices.differentiable if traced else devices.mapped
    means = mapped(partial(_accumulation.mean_of_tile, how), how.mesh, tiles, pair, spp)
    image = means.reshape(-1, *means.shape[2:])[:pixels]
    return devices.everywhere(_shaped(image, (how.height, how.width, *image.shape[1:]), by_rows), how.mesh)


def _in_calls(
    pair: tuple[Any, Any],
    spp: int,
    how: _accumulation.How,
    at_a_time: int,
    progress: Callable[[float], None] | None,
    saved: checkpoints.File | None,
) -> tuple[Array, Array]:
    """Return the same by several calls of a program, each for at most ``at_a_time`` tiles."""
    mesh, size, samples_of_call = how.mesh, how.size, backends.current().samples
    pixels = how.width * how.height
    image, finished, state, samples = None, 0, None, 0
    if saved is not None and saved.state:
        image, finished = _with_part(None, jnp.asarray(saved.state["image"]), 0, pixels)
        samples = int(saved.state["samples"])
        if samples:
            state = jnp.asarray(saved.state["sum"]), jnp.asarray(saved.state["excess"])
    while finished < pixels:
        count = min(at_a_time, -(-(pixels - finished) // size))
        # Parts of a checkpoint may have another size, on other devices.
        count, of_tile = (count, size) if state is None else state[0].shape[:2]
        how = how._replace(size=of_tile)
        tiles = (finished + of_tile * np.arange(count)).astype(np.uint32)
        means = None
        if state is None and count * size * spp <= samples_of_call:
            arguments = devices.place((tiles, np.uint32(spp)), mesh)
            means = devices.local(_accumulation.means(pair, *arguments, how), mesh)
        else:
            if state is None:
                state = _accumulation.zeros(pair[0], (count, size), how.dtype)
            blocks = max(samples_of_call // (count * of_tile * how.block), 1)
            more = min(spp - samples, blocks * how.block)
            arguments = tiles, state, np.uint32(samples // how.block), np.uint32(more // how.block)
            arguments = devices.place(arguments, mesh)
            state = devices.local(_accumulation.accumulate(pair, *arguments, how), mesh)
            samples += more
            if samples == spp:
                means, state, samples = _accumulation.mean(state, np.uint32(spp)), None, 0
        if means is not None:
            part = means.reshape(-1, *means.shape[2:])
            part = part if len(part) <= pixels - finished else part[: pixels - finished]
            image, finished = _with_part(image, part, finished, pixels)
        if saved is not None:
            jax.block_until_ready((image, state))
            if saved.due(last=finished == pixels):
                saved.write(
                    image=np.empty(0) if image is None else image[:finished],
                    sum=np.empty(0) if state is None else state[0],
                    excess=np.empty(0) if state is None else state[1],
                    samples=samples,
                )
        if progress is not None:
            jax.block_until_ready((image, state))
            progress(min((finished + count * of_tile * samples / spp) / pixels, 1.0))
    assert image is not None
    return _in_place(image, (how.height, how.width, *image.shape[1:]), backends.current().caches)


def _with_part(image: Array | None, part: Array, finished: int, pixels: int) -> tuple[Array | None, int]:
    """Return an image extended by the pixels of a part, and its number of pixels."""
    if len(part) == pixels:
        return part, pixels
    if len(part):
        if image is None:
            image = jnp.zeros((pixels, *part.shape[1:]), part.dtype)
        image = _written(image, part, np.uint32(finished))
    return image, finished + len(part)


# Donated: the result reuses the memory of the argument.
@partial(jax.jit, donate_argnums=0)
def _written(image: Array, part: Array, begin: Array) -> Array:
    return jax.lax.dynamic_update_slice_in_dim(image, part, begin, 0)


def _shaped(image: Array, shape: tuple[int, ...], by_rows: bool) -> tuple[Array, Array]:
    """Return the pixels as an image, and whether all are finite.

    ``by_rows``: row by row, since XLA on CPUs would allocate one byte per pixel.
    """
    image = image.reshape(shape)
    if not by_rows:
        return image, jnp.isfinite(image).all()

    def of_row(row: Array, finite: Array) -> Array:
        return finite & jnp.isfinite(image[row]).all()

    return image, jax.lax.fori_loop(np.uint32(0), np.uint32(shape[0]), of_row, jnp.bool_(True))


_in_place = jax.jit(_shaped, static_argnums=(1, 2), donate_argnums=0)
