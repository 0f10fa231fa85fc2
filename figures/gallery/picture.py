"""Draw the picture of the README: ``python figures/gallery/picture.py``, half a minute."""

import io
from pathlib import Path

import numpy as np
from PIL import Image

import qmcjax as qj
from figures import plot
from figures._errors import rms
from figures.shared.sheets.image_sheets import DPI, Panel, image_grid
from qmcjax import orders, samplers, scenes, sequences

SIDE, SPP = 168, 4
SIGMA = 1.5
"""Standard deviation of the Gaussian, in pixels."""


def main() -> None:
    """Render a scene with three samplers, and draw the images above their filtered errors."""
    scene = scenes.occluder()
    dims = len(scene.needs)
    hilbert, raster = orders.hilbert(SIDE, SIDE), orders.raster(SIDE, SIDE)

    def render(sampler, spp):
        return np.asarray(qj.render(scene, sampler, SIDE, SIDE, spp))

    owen = sequences.owen(sequences.sobol(dims), key=2)
    reference = render(samplers.contiguous(hilbert, owen, 1024), 1024)
    images = {
        "random points": samplers.contiguous(raster, sequences.uniform(dims, key=1), SPP),
        "a net in each pixel": samplers.independent(sequences.sobol(dims), key=1),
        "Z-sampler": samplers.z(SIDE, SIDE, SPP, key=1, dims=dims),
    }
    images = {name: render(sampler, SPP) for name, sampler in images.items()}
    weights = np.exp(-2 * (np.pi * SIGMA * np.hypot(*np.meshgrid(*2 * [np.fft.fftfreq(SIDE)]))) ** 2)
    left = {
        name: np.fft.ifft2(weights * np.fft.fft2((image - reference).mean(-1))).real
        for name, image in images.items()
    }
    scale = 2.5 * rms(left["random points"])
    panels = [Panel(name, image, transfer="srgb") for name, image in images.items()]
    panels += [Panel(f"filtered error {rms(each):.4f}", each, (-scale, scale)) for each in left.values()]
    ratio = rms(left["random points"]) / rms(left["Z-sampler"])
    title = f"At {SPP} samples per pixel, random points leave {ratio:.1f} times the error of the Z-sampler"
    title += f"\nBelow: the error after a Gaussian filter of {SIGMA} pixels; grey means no error"
    with plot.rc():
        figure = image_grid(title, panels, 3)
        drawn = io.BytesIO()
        figure.savefig(drawn, dpi=DPI)
    picture = Image.open(drawn).convert("RGB").quantize(256)
    picture.save(Path(__file__).with_name("samplers.png"), optimize=True, dpi=(DPI, DPI))


if __name__ == "__main__":
    main()
