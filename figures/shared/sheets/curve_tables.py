"""The space-filling curves of the two rendering papers, as tables and as images."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

import analysis
from qmcjax import orders, sequences

CURVES = {
    "Morton": orders.morton,
    "Hilbert": orders.hilbert,
    "Moore": orders.moore,
    "Peano": orders.peano,
}
"""In the order of the columns of the Hilbert paper's figures."""

STRONGEST = 0.01
"""The part of an image's frequencies whose share of the power shows regular structures."""

LOW = 1 / 16
"""Cycles per pixel, below which the eye sees errors at a distance."""

SHARE, POWER = "share of the strongest 1 % of frequencies", "power at low frequencies"

EXPLAINED = (
    "In white noise the strongest 1 % of frequencies hold 0.06 of the power, in regular structures "
    "up to all. The power at low frequencies, below 1/16 cycle per pixel, is 1 for white noise."
)
"""What `structure` measures."""


@dataclass(frozen=True)
class Curve:
    """An order that fills a square, given by its positions, [y, x]."""

    positions: NDArray[np.int64]

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.positions.shape[1]

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.positions.shape[0]

    def position(self, x: NDArray, y: NDArray) -> NDArray[np.int64]:
        """Return the positions of pixels."""
        return self.positions[y, x]

    def path(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return columns and rows along the curve."""
        y, x = np.divmod(np.argsort(self.positions, axis=None), self.width)
        return x, y


def curve_of(order: orders.Order) -> Curve:
    """Evaluate an order whose image is its whole raster."""
    x = jnp.arange(order.width, dtype=jnp.uint32)[None, :]
    y = jnp.arange(order.height, dtype=jnp.uint32)[:, None]
    return Curve(np.asarray(jax.jit(lambda: order.position(x, y))()).astype(np.int64))


def square(name: str, binary: int, ternary: int) -> Curve:
    """Make one of the curves to fill a square, whose side is a power of the curve's base."""
    side = ternary if name == "Peano" else binary
    return curve_of(CURVES[name](side, side))


def enumerate_pixels(curve: Curve, sequence: sequences.Sequence, dim: int = 0) -> NDArray[np.float64]:
    """Return the image of one coordinate of a sequence whose points go along the curve, one per pixel."""
    points = sequence.points(curve.positions.size, dtype=jnp.float64)
    return np.asarray(points)[curve.positions, dim]


def structure(image: NDArray[np.float64]) -> dict[str, float]:
    """Measure how regular an image is, and how much power it has at low frequencies; see `EXPLAINED`."""
    spectrum = analysis.error_spectrum(image, np.zeros_like(image))
    distance = np.hypot(*np.meshgrid(*(np.fft.fftfreq(side) for side in spectrum.shape)))
    return {
        SHARE: strongest_share(spectrum),
        POWER: float(spectrum[(distance > 0) & (distance < LOW)].mean()),
    }


def strongest_share(spectrum: NDArray[np.float64]) -> float:
    """Return what part of the power the strongest frequencies have."""
    strongest = np.sort(spectrum, axis=None)[::-1][: round(STRONGEST * spectrum.size)]
    return float(strongest.sum() / spectrum.size)
