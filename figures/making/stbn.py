"""Published textures over space and time, which are not shipped: find and read the user's copy.

A. Wolfe, N. Morrical, T. Akenine-Moeller, R. Ramamoorthi, "Spatiotemporal Blue Noise Masks", 2022 (STBN), and
W. Donnelly, A. Wolfe, J. Buetepage, J. Valdes, "FAST: Filter-Adapted Spatio-Temporal Sampling for Real-Time
Rendering", 2024, come with a file per frame: ``stbn_vec2_2Dx1D_128x128x64_<frame>.png``, for example.
"""

import os
import re
from pathlib import Path
from typing import Any

SWITCH = "QMCJAX_FIGURES_STBN"
"""The environment variable that passes the folder to worker processes."""

SUFFIXES = (".png", ".npy", ".exr")


def path() -> Path | None:
    """Return the folder that the user has named, if any."""
    named = os.environ.get(SWITCH)
    return Path(named) if named else None


def slices(folder: Path) -> list[Path]:
    """Return the files of frames 0, 1, ... in a folder.

    Raises ValueError if there are none, if they belong to several textures, or if a frame is missing.
    """
    textures: dict[tuple[str, str], dict[int, Path]] = {}
    for file in sorted(folder.iterdir()) if folder.is_dir() else []:
        named = re.fullmatch(r"(.*)_(\d+)", file.stem)
        if named and file.suffix in SUFFIXES:
            textures.setdefault((named[1], file.suffix), {})[int(named[2])] = file
    if len(textures) != 1:
        names = ", ".join(sorted(name + suffix for name, suffix in textures)) or "none"
        raise ValueError(f"{folder} must have the files NAME_0{'|'.join(SUFFIXES)}, ... of one, got {names}")
    (((name, suffix), frames),) = textures.items()
    last = max(frames)
    for number in range(last):
        if number not in frames:
            raise ValueError(f"{folder} must have all frames to {last}: {name}_{number}{suffix} is missing")
    return [frames[number] for number in range(last + 1)]


def read(folder: Path) -> Any:
    """Return a texture in [0, 1), shape (frames, rows, columns, 1 or 2).

    The first two channels that are neither constant nor equal are used. Values of PNG files are the centres
    of equal parts of [0, 1).

    Raises OSError if a file cannot be read, and ValueError if the folder has no texture, or if files differ
    in shape, are not images or have values outside [0, 1].
    """
    import numpy as np

    from qmcjax.bridges import read_image

    files = slices(folder)
    # No transfer function: the values are data, not light.
    frames = [
        np.asarray(read_image(file, transfer="linear" if file.suffix == ".png" else None), np.float64)
        for file in files
    ]
    for file, frame in zip(files, frames, strict=True):
        if frame.shape != frames[0].shape:
            raise ValueError(f"{file} must have the shape of frame 0, {frames[0].shape}, got {frame.shape}")
        if frame.min() < 0 or frame.max() > 1:
            raise ValueError(f"{file} must have values in [0, 1], got {frame.min()} to {frame.max()}")
    texture = np.stack(frames).reshape(len(frames), *frames[0].shape[:2], -1)
    if files[0].suffix == ".png":
        levels = 255 if np.allclose(texture * 255, np.rint(texture * 255), atol=1e-4) else 65535
        texture = (np.rint(texture * levels) + 0.5) / (levels + 1)
    channels: list[Any] = []
    for channel in np.moveaxis(texture, -1, 0):
        if np.ptp(channel) and not any(np.array_equal(channel, other) for other in channels):
            channels.append(np.minimum(channel, np.nextafter(1.0, 0.0)))
    if not channels:
        raise ValueError(f"{folder} must have values that differ, got {texture.ravel()[0]} only")
    return np.stack(channels[:2], axis=-1)
