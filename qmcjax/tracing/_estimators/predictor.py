"""Images of intervals of the shutter, predicted and corrected by samples (thesis, Sect. 3.3.4)."""

from typing import Any, NamedTuple

import numpy as np
from jax import Array
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import numbers, require
from qmcjax.tracing._estimators.deep_image import Renderer, Step
from qmcjax.tracing._estimators.estimator import Estimator


class PredictorCorrector(NamedTuple):
    """The image of a shutter and of its intervals; see :func:`predictor_corrector`."""

    image: NDArray[np.float32]
    """(height, width, 3): the mean of all images."""
    images: NDArray[np.float32]
    """(n, height, width, 3): one image per interval, in order."""
    samples: NDArray[np.int32]
    """(n, height, width): samples per pixel; pixels with fewer than ``fail`` are predicted."""
    steps: tuple[Step, ...]
    """The predictions, in order."""


def predictor_corrector(
    scene: Estimator,
    width: int,
    height: int,
    samples: tuple[int, ...],
    fail: int,
    key: Array | int,
    *,
    contrast: float = 0.3,
) -> PredictorCorrector:
    """Render a shutter of 2^m + 1 intervals, and predict most of their images.

    Images of the first and last interval are sampled. The image half-way between two known ones is predicted
    from both: pixels move with their nearest hit, triangles between them are rasterized with a z-buffer, and
    the colours of both predictions are averaged. All other data of a pixel (x, y) are those of the first
    prediction if x xor y is even, else those of the second [1]_. If one of them does not cover a pixel, the
    other is used. A few samples then detect where prediction failed.

    The result is biased: shadows and reflections, which move independently of their surface, are not
    predicted, and errors below the contrast remain. Noise of sampled images propagates to predicted ones.

    Parameters
    ----------
    scene : Estimator
        Made by :func:`direct_light`, :func:`path_tracing` or :func:`bidirectional`, with finite values, a
        camera without a lens, and no triangles with ``close``.
    width, height : int
        In [1, 65536].
    samples : tuple of int
        For each of the m <= 12 levels of recursion, the number of samples per pixel that check the
        prediction, at most ``fail``; 0 keeps all predictions.
    fail : int
        Samples of a pixel without a prediction, at least 1.
    key : int or JAX key
        Key of the random samples.
    contrast : float, optional
        In [0, 1]: a prediction p fails if abs(p - e) > contrast (p + e) in a colour channel, with the mean e
        of the checking samples.

    Returns
    -------
    PredictorCorrector
        NumPy arrays.

    Notes
    -----
    A pixel moves from its centre by the displacement of the stored point on the screen. Moving the stored
    points themselves, which lie anywhere in their pixels, would blur still objects.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008, Sect. 3.3.4.
    .. [2] A. Keller, "Hierarchical Monte Carlo Image Synthesis", 2001.

    Examples
    --------
    >>> from qmcjax import tracing
    >>> slides = tracing.motion.affine(None, tracing.motion.linear_segments([0, 1], [[-1, 0, 0], [1, 0, 0]]))
    >>> ball = tracing.sphere([0, 0, 0], 1.0, motion=slides, material=tracing.emitter(1.0))
    >>> scene = tracing.direct_light(tracing.world([ball]), tracing.camera([0, 0, 9], [0, 0, 0]))
    >>> found = predictor_corrector(scene, 16, 16, (4, 2, 1), 32, key=1)
    >>> print(found.images.shape, [step.middle for step in found.steps])
    (9, 16, 16, 3) [4, 2, 6, 1, 3, 5, 7]
    """
    _check(scene)
    width, height = checks.image_size(width, height)
    fail = checks.integer("fail", fail, 1, 2**20)
    if not isinstance(samples, tuple | list) or not 1 <= len(samples) <= 12:
        raise TypeError(f"samples must be a tuple of 1 to 12 integers, got {checks.shown(samples)}")
    counts = [checks.integer("samples", count, 0, fail) for count in samples]
    limit = numbers("contrast", contrast)
    require("contrast", limit, lambda c: (c >= 0) & (c <= 1), "in [0, 1]")
    render = Renderer(scene, width, height, 2 ** len(counts) + 1, checks.prng_key("key", key))
    steps = _steps(len(counts))
    known = {end: render.sample(end, np.arange(width * height), fail, 0) for end in (0, render.intervals - 1)}
    taken = {end: np.full(width * height, fail, np.int32) for end in known}
    for step in steps:
        predicted, covered = render.predict(known[step.left], known[step.right], step)
        known[step.middle], taken[step.middle] = render.correct(
            predicted, covered, step, counts[step.level - 1], fail, float(limit)
        )
    images = np.stack([known[k].color.reshape(height, width, 3) for k in range(render.intervals)])
    if not np.isfinite(images).all():
        raise ValueError("scene must have finite values, got NaN or infinity")
    of_all = np.stack([taken[k].reshape(height, width) for k in range(render.intervals)])
    image = images.mean(axis=0, dtype=np.float64).astype(np.float32)
    return PredictorCorrector(image, images, of_all, steps)


def _steps(levels: int) -> tuple[Step, ...]:
    """Return all predictions of 2^levels + 1 intervals, level by level (thesis, Fig. 3.3)."""
    steps = []
    for level in range(1, levels + 1):
        apart = 2 ** (levels - level + 1)
        for left in range(0, 2**levels, apart):
            steps.append(Step(left, left + apart // 2, left + apart, level))
    return tuple(steps)


def _check(scene: Any) -> None:
    if not isinstance(scene, Estimator):
        raise TypeError(
            f"scene must be made by qmcjax.tracing (direct_light, ...), got {checks.shown(scene)}"
        )
    if scene.camera.aperture is not None:
        raise ValueError("scene must have a camera without a lens, got one with an aperture")
    for place, item in enumerate(scene.world.objects):
        if any(shape.moving for shape in item.shapes):
            raise TypeError(
                f"scene must move by motions of its objects, got shapes that move in object {place}"
            )
