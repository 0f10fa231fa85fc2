"""A mask of blue noise as a file: ``qmcjax mask --channels 1 --side 512 --out mask.npy``."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from figures._options import command
from figures.making import store
from qmcjax.samplers import blue_noise_mask


def main(argv: Sequence[str] | None = None) -> int:
    """Write the array that ``blue_noise_mask`` returns, under a temporary name until it is complete."""
    parser = command(
        "mask", "Make a tileable mask of blue noise, for samplers.dither(numpy.load(FILE), ...)."
    )
    parser.add_argument("--channels", type=int, default=2, metavar="N", help="of a pixel (default: 2)")
    parser.add_argument("--side", type=int, metavar="N", help="pixels, a power of two from 16 to 512")
    parser.add_argument("--frames", type=int, metavar="N", help="of an animation (default: a single mask)")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the .npy file to write")
    given = parser.parse_args(argv)
    stream = io.BytesIO()
    try:
        np.save(stream, blue_noise_mask(given.channels, given.side, given.frames))
        store.write(given.out, stream.getvalue())
    except (OSError, ValueError) as error:
        parser.error(str(error))
    print(f"{given.out}: {stream.tell()} bytes")
    return 0
