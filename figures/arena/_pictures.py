"""The pictures of a comparison: errors over samples with bands, and spectra at few samples."""

import io

import numpy as np
from matplotlib.figure import Figure

from analysis import Comparison
from figures import plot

DPI = 100
"""Pictures are as wide as the page, in pixels."""

MEASURES = ("RMS error", "filtered error", "perceived error")


def errors(compared: Comparison, scene: str) -> bytes | None:
    """Return a PNG with a panel for each measure; None where there is no line to draw."""
    names = list(dict.fromkeys(row.sampler for row in compared.rows if row.scene == scene))
    counts = sorted({row.spp for row in compared.rows if row.scene == scene})
    shown = [name for name in names if len(compared.errors(scene, name)[0]) == len(counts)]
    if not shown or len(counts) < 2:
        return None
    figure = Figure(figsize=(3.9 * len(MEASURES), 3.6), layout="constrained")
    for axes, measure in zip(figure.subplots(1, len(MEASURES)), MEASURES, strict=True):
        means, bands = {}, {}
        for name in shown:
            rows = [compared.row(scene, name, spp) for spp in counts]
            means[name] = [row.mean(measure) for row in rows]
            band = np.transpose([row.interval(measure) for row in rows])
            if np.isfinite(band).all():
                bands[name] = band
        if all(min(values) > 0 for values in means.values()):
            plot.convergence(counts, means, bands=bands, title=f"{scene}: {measure}", ylabel=measure, ax=axes)
    return _png(figure)


def spectra(compared: Comparison, scene: str) -> bytes:
    """Return a PNG with the radial power of errors, at the least and the most samples."""
    counts = sorted({row.spp for row in compared.rows if row.scene == scene})
    counts = counts[:: max(1, len(counts) - 1)]
    figure = Figure(figsize=(5.8 * len(counts), 3.4), layout="constrained")
    for axes, spp in zip(np.ravel(figure.subplots(1, len(counts))), counts, strict=True):
        rows = [row for row in compared.rows if (row.scene, row.spp) == (scene, spp)]
        for row in rows:
            drawn = plot.style(row.sampler, [each.sampler for each in rows])
            axes.plot(row.frequency, row.power, drawn.line, color=drawn.color, lw=1.2, label=row.sampler)
        axes.axhline(1, color="0.6", lw=0.8, zorder=0)
        axes.set(
            xlim=(0, 0.5),
            ylim=(0, None),
            xlabel="cycles per pixel",
            ylabel="power of the error (white noise: 1)",
            title=f"{scene}, {spp} spp",
        )
        axes.legend(fontsize=8, frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    return _png(figure)


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()
