"""Derivatives of pixel means with respect to parameters that move edges."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.flatten_util import ravel_pytree
from jax.sharding import Mesh
from jax.typing import DTypeLike

from qmcjax.core import checks, devices, summation
from qmcjax.core.pytrees import jit
from qmcjax.scenes import Scene, as_scene
from qmcjax.sequences import SequenceLike, as_sequence

_PARTS = 8
"""Parts of the points, distributed over devices."""

_BLOCK = 2**10, 2**18
"""Smallest and largest number of points on edges that are summed together."""


def boundary_gradient(
    scene: Scene,
    sequence: SequenceLike,
    width: int,
    height: int,
    n: int,
    *,
    dtype: DTypeLike = jnp.float32,
    mesh: Mesh | None = None,
) -> Any:
    r"""Estimate the derivative of every pixel's mean with respect to every parameter, by sampling the edges.

    Where a parameter moves an edge, the derivative of a sample's value is 0 almost everywhere, but the mean
    changes with the area that the edge sweeps. For a scene that is constant between edges, Reynolds'
    transport theorem gives

    .. math:: \frac{\partial}{\partial \theta} \int_P f \, dp
              = \int_{\partial \cap P} (f_- - f_+) \, \frac{\partial p}{\partial \theta} \cdot \nu \, ds
              = \int_{[0,1)} [p(u) \in P] \, j(u) \det\left(\frac{\partial p}{\partial \theta},
                \frac{\partial p}{\partial u}\right) du

    with the normal :math:`\nu` from the side of :math:`f_-` to that of :math:`f_+`: an edge that moves along
    its normal leaves :math:`f_-` behind. The edges are curves :math:`p(u)`, with :math:`f_-` on the side of
    the tangent rotated by 90 degrees from x to y, and the jump is :math:`j = f_- - f_+`. The tangent rotated
    the other way, :math:`(p_{u,y}, -p_{u,x})`, is :math:`\nu \, ds/du`, so the determinant, the cross product
    of both derivatives, is the swept area; motion of p along the edge does not matter. In d dimensions u has
    d - 1 coordinates; their derivatives are the other columns.

    The estimate is the mean over n points u of a sequence, each added to the pixel it hits and divided by the
    area of a pixel. It is unbiased if every u is uniform; with a low discrepancy sequence the error of a
    curve falls like 1/n.

    Parameters
    ----------
    scene : Scene
        A pytree with parameters and a method ``boundary(u)``: from u, shape (..., len(needs) - 1), to points,
        shape (..., len(needs)), and jumps, shape (...), of finitely many edges. Points outside the unit cube
        are ignored. Parameters must only move edges.
    sequence : Sequence
        Points u: one dimension for two-dimensional scenes. Further dimensions are ignored.
    width, height : int, in [1, 65536]
    n : int
        Number of points on the edges of the whole image, in [1, 2**31].
    dtype : float32 or float64
    mesh : jax.sharding.Mesh, optional
        Devices that share the points, as for :func:`qmcjax.render`. Points are summed in 8 parts, so more
        than 8 devices do not help. The parts need the memory of 8 results.

    Returns
    -------
    Scene
        The scene with each parameter replaced by its gradient: an Array of ``dtype``, shape (height, width)
        followed by the shape of the parameter.

    Notes
    -----
    An edge on the border between two pixels moves into one or the other, depending on the direction: only the
    sum over both has a derivative. If an edge grazes a border, its points in float32, off by 1e-7, may fall
    on the wrong side: float64 helps.

    References
    ----------
    .. [1] T.-M. Li, M. Aittala, F. Durand, J. Lehtinen, "Differentiable Monte Carlo Ray Tracing through Edge
       Sampling", 2018.

    Examples
    --------
    >>> from qmcjax import boundary_gradient, scenes, sequences
    >>> scene = scenes.step(angle=0.0, offset=0.3)
    >>> print(boundary_gradient(scene, sequences.van_der_corput(), 2, 1, 256).offset.round(3))
    [[2. 0.]]
    """
    scene, sequence = as_scene("scene", scene), as_sequence("sequence", sequence)
    width, height = checks.image_size(width, height)
    dtype = checks.floating(dtype)
    if not hasattr(scene, "boundary"):
        raise TypeError(
            f"scene must have boundary(u), got {checks.shown(scene)}: without edges, jax.grad of a mean is "
            "right"
        )
    if not jax.tree.leaves(scene):
        raise TypeError(
            f"scene must be a pytree with arrays as parameters, got {checks.shown(scene)} without any"
        )
    free = len(scene.needs) - 1
    if sequence.dims < free:
        raise ValueError(
            f"sequence must have the {free} dimensions of the edges of {checks.shown(scene)}, got "
            f"{sequence.dims}"
        )
    n = checks.integer("n", n, 1, min(sequence.limit, 2**31))
    if width * height >= 2**31:
        raise ValueError(f"width times height must be below 2**31, got {width} * {height}")
    least, largest = _BLOCK
    # Each point has one matrix per parameter.
    numbers = (free + 1) ** 2 * sum(np.size(leaf) for leaf in jax.tree.leaves(scene))
    rows = min(max(width * height, least), max(largest * 16 // max(numbers, 16), least))
    mesh = devices.validate_mesh(mesh)
    with checks.precision(dtype):
        scene = jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(dtype), scene)
        blocks = -(-n // rows)
        count = min(blocks, _PARTS)
        edges = (np.arange(count + 1, dtype=np.uint64) * np.uint64(blocks) // np.uint64(count)).astype(
            np.uint32
        )
        arguments = devices.place((scene, sequence, np.uint32(n), edges), mesh)
        return devices.local(_gradient(*arguments, width, height, rows, dtype, mesh), mesh)


@jit("width", "height", "rows", "dtype", "mesh")
def _gradient(
    scene: Scene,
    sequence: SequenceLike,
    n: Array,
    edges: Array,
    width: int,
    height: int,
    rows: int,
    dtype: DTypeLike,
    mesh: Mesh | None,
) -> Any:
    leaves, tree = jax.tree.flatten(scene)

    def block(parameters: Any, k: Array) -> Array:
        """Return the sums over one block of points, shape (height * width, number of parameters)."""
        scene, sequence, n = parameters
        index = k * np.uint32(rows) + jax.lax.iota(jnp.uint32, rows)
        dims = tuple(range(len(scene.needs) - 1))
        u = sequence.coordinates(jnp.minimum(index, n - 1), dims, dtype)
        point, jump = scene.boundary(u)
        if point.shape != (rows, len(scene.needs)) or jump.shape != (rows,):
            raise ValueError(
                f"scene.boundary must return points {(rows, len(scene.needs))} and jumps {(rows,)} for u "
                f"{u.shape}, got {point.shape} and {jump.shape}"
            )
        swept = jump[:, None] * _swept(scene, u)
        inside = (index < n) & jnp.all((point >= 0) & (point < 1), axis=-1)
        # Below 1, the product with a size never rounds up to the size.
        column, row = ((point[:, axis] * size).astype(jnp.int32) for axis, size in enumerate((width, height)))
        pixel = row * width + column
        beyond = width * height
        image = jnp.zeros((beyond, swept.shape[1]), dtype)
        return image.at[jnp.where(inside, pixel, beyond)].add(swept, mode="drop")

    def of_part(edges: tuple[Array, Array], *parameters: Any) -> Array:
        first, end = edges
        state = summation.zeros(jax.eval_shape(block, parameters, first))
        state = summation.add_terms(block, False, parameters, state, first, end - first)
        return summation.value(state)  # pyright: ignore[reportArgumentType]

    total = devices.summed(of_part, mesh, False, (edges[:-1], edges[1:]), scene, sequence, n)
    sums = total * (width * height / n.astype(dtype))
    ends = np.cumsum([leaf.size for leaf in leaves])
    images = jnp.split(sums, ends[:-1], axis=1)
    return tree.unflatten(
        [image.reshape(height, width, *leaf.shape) for image, leaf in zip(images, leaves, strict=True)]
    )


def _swept(scene: Any, u: Array) -> Array:
    """Return the determinants of the points' derivatives, shape (points, number of parameters)."""
    flat, restore = ravel_pytree(scene)

    def move(flat: Array) -> Array:
        return restore(flat).boundary(u)[0]

    def slide(u: Array) -> Array:
        return scene.boundary(u)[0]

    moved = jax.vmap(lambda d: jax.jvp(move, (flat,), (d,))[1])(jnp.eye(flat.size, dtype=u.dtype))
    # Made from u, to vary like u inside jax.shard_map.
    steps = [jnp.zeros_like(u).at[..., j].set(1) for j in range(u.shape[-1])]
    slid = [jax.jvp(slide, (u,), (step,))[1] for step in steps]
    columns = [jnp.broadcast_to(column, moved.shape) for column in slid]
    return jnp.linalg.det(jnp.stack([moved, *columns], axis=-1)).T
