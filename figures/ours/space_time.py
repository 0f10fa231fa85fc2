"""Samplers of animations: what filters in space and time leave of their errors, a moving picture."""

import io
from collections.abc import Callable, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import analysis
from figures import plot
from figures.shared import judged
from figures.shared.integrands import integrands_of_dims
from figures.shared.integrands.animations import FRAMES, METHODS, errors, image
from qmcjax import scenes
from qmcjax.core import student

GAP, HEAD = 4, 14
"""Pixels between images, and above them for names."""

ZOOM, MILLISECONDS, QUALITY = 2, 120, 40


def average(frames: NDArray, alpha: float, rounds: int = 3, history: Any = 1.0) -> NDArray:
    """Return moving averages after some rounds of the frames: as if they had always been repeated.

    ``history``: what a step multiplies earlier frames with, in addition: the transfer function of a motion.
    """
    mean, found = frames.mean(axis=0), np.empty_like(frames)
    for _ in range(rounds):
        for k, frame in enumerate(frames):
            mean = (1 - alpha) * history * mean + alpha * frame
            found[k] = mean
    return found


def moving_picture(ways: Mapping[str, NDArray[np.float64]], alpha: float) -> bytes:
    """Return an endless WebP: a column for each way, frames above their moving average.

    ``ways``: linear values, shape (frames, height, width), by the names of samplers.
    """
    columns = {name: (frames, average(frames, alpha)) for name, frames in ways.items()}
    count, height, width = next(iter(ways.values())).shape
    pictures = []
    for t in range(count):
        size = len(columns) * (ZOOM * width + GAP) - GAP, 2 * (ZOOM * height + GAP) - GAP + HEAD
        picture = Image.new("L", size, 255)
        drawn = ImageDraw.Draw(picture)
        for k, (name, rows) in enumerate(columns.items()):
            left = k * (ZOOM * width + GAP)
            drawn.text((left, 0), name, fill=0, font_size=10)
            for row, frames in enumerate(rows):
                values = np.round(255 * plot.srgb(np.clip(frames[t], 0, 1))).astype(np.uint8)
                large = values.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1)
                picture.paste(Image.fromarray(large), (left, HEAD + row * (ZOOM * height + GAP)))
        pictures.append(picture)
    file = io.BytesIO()
    first, *others = pictures
    first.save(
        file,
        format="webp",
        save_all=True,
        append_images=others,
        duration=MILLISECONDS,
        loop=0,
        quality=QUALITY,
        method=4,
    )
    return file.getvalue()


SIDE = {"draft": 32, "paper": 64}
KEYS = {"draft": 4, "paper": 16}
CASES = {"draft": ((2, 1),), "paper": ((2, 1), (2, 4), (4, 1), (4, 4))}
"""Dimensions and samples per pixel and frame."""

ALPHA = 0.1
"""Weight of a new frame in moving averages."""

AVERAGE, WINDOW = analysis.moving_average(ALPHA), np.ones(8)
COLUMNS: Mapping[str, tuple[float, Any]] = {
    "space": (1.5, 0.0),
    "space\n+ EMA": (1.5, AVERAGE),
    "space\n+ Gauss": (1.5, 1.5),
    "EMA": (0.0, AVERAGE),
    "last 8\nframes": (0.0, WINDOW),
}
"""Filters: in space, and in time."""

BLOCKS, REPROJECTED = "blocks\nof 8", "EMA re-\nprojected"
"""Further columns: averages that begin anew every eight frames, or follow a moving camera."""

HEADS = (*COLUMNS, BLOCKS, REPROJECTED)

PAN = (0.7, 1.3)
"""Pixels by which the camera moves in each frame: downward, and to the right."""


MOVING = ("Z, new keys", "optimised orders, in time", "designed tile")
"""Columns of the moving picture."""

NOTE = (
    f"{{side}} x {{side}} pixels, {FRAMES} frames, {{keys}} keys. RMS over half-spaces, balls, bumps and "
    f"products, {integrands_of_dims.COUNT} of each, the same in all pixels and frames, relative to white "
    "noise after the same filter; geometric means over keys. Filters in space are Gaussians of 1.5 "
    "pixels; the moving average (EMA) takes 0.1 of each frame, the Gaussian in time has 1.5 frames. "
    f"Frames repeat: golden-ratio shifts jump once in {FRAMES} frames. The targets were 0.55, 0.45, "
    "0.45, 0.60, and 0.60 for blocks, without a tile. The reprojected average takes its history from "
    f"where the surface was, by bilinear interpolation; the camera moves by {PAN[1]} and {PAN[0]} pixels "
    "a frame. The animation is a soft shadow with one sample per pixel and frame. "
)


def shadow(points: Array) -> Array:
    """Return the values of a soft shadow, whose pixels the first two coordinates sample."""
    rows, columns = points.shape[:2]
    x = (jnp.arange(columns, dtype=points.dtype)[None] + points[..., 0]) / columns
    y = (jnp.arange(rows, dtype=points.dtype)[:, None] + points[..., 1]) / rows
    return scenes.soft_shadow()(jnp.concatenate([x[..., None], y[..., None], points[..., 2:]], axis=-1))


def moving() -> bytes:
    """Return a moving picture of the soft shadow, one sample per pixel and frame."""
    side, dims = SIDE["paper"], len(scenes.soft_shadow().needs)
    ways = {name: METHODS[name](side, 1, dims, 1) for name in MOVING}
    frames = {
        name: np.stack([np.asarray(image(of(t), side, side, 1, dims, shadow), float) for t in range(FRAMES)])
        for name, of in ways.items()
    }
    return moving_picture(frames, ALPHA)


def columns(error: NDArray[np.float64]) -> list[float]:
    """Return root mean squares of errors after each filter."""
    none = np.zeros(error.shape[1:])
    found = [analysis.filtered_error(error, none, sigma, time) for sigma, time in COLUMNS.values()]
    in_blocks = error.reshape(-1, len(WINDOW), *error.shape[1:]).mean(axis=1)
    return [*found, analysis.filtered_error(in_blocks, none, 0, 0), _reprojected(error)]


def _reprojected(error: NDArray[np.float64]) -> float:
    """Return the root mean square of moving averages whose history moves with the camera."""
    move: Any = 1.0
    for axis, pan in enumerate(PAN):
        turn = np.exp(-2j * np.pi * np.fft.fftfreq(error.shape[1 + axis]))
        whole, part = divmod(pan, 1)
        along = turn**whole * (1 - part + part * turn)
        move = move * along.reshape(-1, *(1,) * (error.ndim - 2 - axis))
    spectra = np.fft.fft2(error, axes=(1, 2), norm="forward")
    moved = average(spectra, ALPHA, history=move)
    return float(np.sqrt(np.square(np.abs(moved)).sum(axis=(1, 2)).mean()))


def white(shape: tuple[int, ...], spp: int) -> list[float]:
    """Return what is expected of independent samples: what an impulse leaves."""
    impulse = np.zeros(shape)
    impulse[0, 0, 0] = np.sqrt(impulse.size / spp)
    return columns(impulse)


def verdicts(logs: Mapping[str, NDArray[np.float64]], labels: list[str]) -> dict[str, str]:
    """Say by column which way leaves least, or between which that is undecided, by joint comparisons."""
    names, said = list(logs), {}
    for k, label in enumerate(labels):
        found = np.stack([logs[name][:, k] for name in names])
        least = int(found.mean(axis=1).argmin())
        low, _ = student.differences(found[None])
        open_ = [names[j] for j in range(len(names)) if j != least and not low[j, least] > 0]
        between = " or ".join([names[least], *open_])
        said[label] = f"undecided: {between}" if open_ else f"{between} least"
    return said


Tables = dict[str, dict[str, NDArray[np.float64]]]
"""By case and way: logarithms of errors of each key after each filter."""


def measure(quality: str, progress: Callable[[float], None]) -> tuple[Tables, dict, dict[str, bytes]]:
    """Measure all ways through the frames, and return numbers, and the moving picture."""
    side, keys = SIDE[quality], KEYS[quality]
    shape = FRAMES, side, side
    labels = [name.replace("re-\n", "re").replace("\n", " ") for name in HEADS]
    relative: Tables = {}
    steps = len(CASES[quality]) * len(METHODS)
    for dims, spp in CASES[quality]:
        logs = relative[f"{dims}-D, {spp} spp"] = {}
        expected = np.array(white(shape, spp))
        for done, (name, animation) in enumerate(METHODS.items(), start=1):
            found = []
            for key in range(1, keys + 1):
                error = errors(animation(side, spp, dims, key), shape, spp, dims)
                found.append(np.log(columns(error) / expected))
            logs[name] = np.stack(found)
            progress(((len(relative) - 1) * len(METHODS) + done) / steps)
    said = {
        case: verdicts({n: of for n, of in logs.items() if n != "random"}, labels)
        for case, logs in relative.items()
    }
    measured = {
        case: {
            name: {label: list(judged.of_logarithms(of[:, k])) for k, label in enumerate(labels)}
            for name, of in logs.items()
        }
        for case, logs in relative.items()
    }
    numbers: dict[str, Any] = {"measured": {"error / white noise": measured, "verdicts": said}}
    numbers["note"] = NOTE.format(side=side, keys=keys)
    return relative, numbers, {} if quality == "draft" else {"frames.webp": moving()}


def draw_table(axes: Axes, table: Mapping[str, NDArray[np.float64]]) -> None:
    """Draw errors after each filter as colours and numbers, the least of each filter in bold."""
    cells = np.exp([logs.mean(axis=0) for logs in table.values()])
    axes.imshow(np.log2(cells), cmap="RdYlBu_r", vmin=-1.5, vmax=1.5, aspect="auto")
    for row, of in enumerate(cells):
        for column, value in enumerate(of):
            least, dark = value == cells[:, column].min(), abs(np.log2(value)) > 1.3
            look: dict[str, Any] = {
                "weight": "bold" if least else "normal",
                "color": "white" if dark else "black",
            }
            axes.text(column, row, f"{value:.2f}", ha="center", va="center", **look)
    axes.set_xticks(range(cells.shape[1]), HEADS)
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_yticks(range(len(table)), list(table))
    axes.set_xlabel("filter of the errors, in space or over frames")
