"""Power spectra, in the plane and by their radial means."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

import analysis
from figures.plot._panel import check_texts, panel
from figures.plot._style import style
from qmcjax.core.parameters import known, numbers


def spectrum(
    spectra: ArrayLike | Mapping[str, ArrayLike], *, title: str = "", ax: Axes | None = None
) -> Axes:
    """Draw a spectrum with frequency 0 in its middle, or the radial means of several.

    Parameters
    ----------
    spectra : float ArrayLike, shape (height, width), or mapping of samplers' names to such
        In the layout of ``numpy.fft.fft2``, such as from :func:`analysis.error_spectrum` or
        :func:`analysis.point_spectrum`: white noise has 1. One is drawn as an image, in which 0 is black and
        3 or more white; of several, the mean power over frequency.
    title : str, optional
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    TypeError
        If ``ax`` is no Axes.
    ValueError
        If a spectrum has another shape.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = analysis.error_spectrum(rng.random((32, 32)), np.zeros((32, 32)))
    >>> ax = spectrum({"random": noise, "mine": noise})
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    cycles per pixel | power (white noise: 1)
    """
    check_texts(title=title)
    if not isinstance(spectra, Mapping):
        power = numbers("spectra", known("spectra", spectra), (None, None))
        ax = panel(ax, (3.4, 3.4))
        ax.imshow(
            np.fft.fftshift(power),
            cmap="gray",
            vmin=0,
            vmax=3,
            interpolation="nearest",
            extent=(-0.5, 0.5, 0.5, -0.5),
        )
        ax.set(xticks=[-0.5, 0, 0.5], yticks=[-0.5, 0, 0.5], xlabel="cycles per pixel", title=title)
        return ax
    ax = panel(ax, (4.8, 3.2))
    for name, of in spectra.items():
        power = numbers(f"spectra[{name!r}]", known("spectra", of), (None, None))
        frequency, mean = analysis.radial_average(power)
        drawn = style(name, spectra)
        ax.plot(frequency / max(np.shape(of)), mean, drawn.line, color=drawn.color, lw=1.2, label=name)
    ax.axhline(1, color="0.6", lw=0.8, zorder=0)
    ax.set(
        xlim=(0, 0.5), ylim=(0, None), xlabel="cycles per pixel", ylabel="power (white noise: 1)", title=title
    )
    ax.legend(frameon=False)
    return ax
