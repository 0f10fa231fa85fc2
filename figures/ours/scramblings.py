"""Ways to scramble Sobol's sequence: errors and distances of points over their number."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures._rc import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION
from figures.plot import Style
from qmcjax import sequences

CANDIDATES = 50
WAYS: dict[str, tuple[Callable[[Any, int], Any], Style]] = {
    "digital shift": (lambda key, n: sequences.digital_shift(sequences.sobol(2), key), Style(GREY, "x", ":")),
    "Owen, hashed": (lambda key, n: sequences.owen(sequences.sobol(2), key), Style(ORANGE, "o")),
    "Owen, exact": (
        lambda key, n: sequences.owen_exact(sequences.sobol(2), key),
        Style(VERMILLION, "s"),
    ),
    "ART-Owen": (lambda key, n: sequences.art_owen(sequences.sobol(2), key), Style(PURPLE, "v", "-.")),
    "net by net": (lambda key, n: sequences.net_by_net(sequences.sobol(2), n, key), Style(GREEN, "^", "--")),
    "pmj02": (lambda key, n: sequences.pmj02(n, key), Style(BLUE, "D", "-.")),
    f"pmj02, best of {CANDIDATES}": (lambda key, n: sequences.pmj02(n, key, CANDIDATES), Style(SKY, "*")),
}
EDGES = np.random.default_rng(1).normal(size=(16, 2))
MEANS = {"smooth": (np.e - 1) ** 2, "edges": 0.5}
NAMES = {"smooth": "exponential of x + y", "edges": "half planes through the centre"}


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw errors of two integrands and minimum distances, for each way to scramble."""
    log_most, keys = (12, 256) if quality == "paper" else (5, 8)
    counts = [2**m for m in range(2, log_most + 1)]
    found = {}
    for done, (name, (scramble, _)) in enumerate(WAYS.items(), start=1):
        found[name] = _measured(_points(scramble, counts[-1], keys), counts)
        progress(done / len(WAYS))
    exact = found["Owen, exact"]
    ratios = {
        name: {kind: _ratio(of_name[kind], exact[kind]) for kind in (*MEANS, "distance")}
        for name, of_name in found.items()
    }
    best = ratios[f"pmj02, best of {CANDIDATES}"]
    apart, smooth = best["distance"], best["smooth"]
    return _draw(found, counts, keys), {
        "measured": {
            "points": counts,
            "keys": keys,
            "root mean square errors and mean minimum distances times sqrt(n)": found,
            "geometric mean over exact Owen scrambling": ratios,
        },
        "note": f"Over {keys} keys; the grey band is one standard deviation of such a ratio by chance. A "
        "mean varies as with exact Owen scrambling if any two points do: so for ART-Owen scrambling and net "
        "by net, by theorems, and with the hash, by its tests. pmj02 has these points in another order "
        f"within each power of two. The best of {CANDIDATES} places for each point keeps points apart, by a "
        f"factor of {apart:.2f} in the mean, early ones more; later are bound to small squares. It takes "
        f"precision for the smooth integrand, a factor of {smooth:.2f} in the error. A digital shift leaves "
        "n^-1 there.",
    }


def _points(scramble: Callable[[Any, int], Any], n: int, keys: int) -> NDArray[np.float64]:
    """Return points for some keys, shape (keys, n, 2)."""
    index = jnp.arange(n, dtype=jnp.uint32)
    draw = jax.jit(jax.vmap(lambda key: scramble(key, n).bits(index)))
    return np.asarray(draw(jax.random.split(jax.random.key(2), keys))) / 2.0**32


def _measured(points: NDArray[np.float64], counts: list[int]) -> dict[str, list[float]]:
    values = {
        "smooth": np.exp(points.sum(axis=-1))[..., None],
        "edges": ((points - 0.5) @ EDGES.T < 0).astype(np.float64),
    }
    result = {}
    for kind, value in values.items():
        means = value.cumsum(axis=1)[:, np.array(counts) - 1] / np.array(counts)[None, :, None]
        result[kind] = np.sqrt(((means - MEANS[kind]) ** 2).mean(axis=(0, 2))).tolist()
    few = points[:32]
    result["distance"] = [
        float(np.mean([analysis.min_distance(p[:n]) for p in few]) * np.sqrt(n)) for n in counts
    ]
    return result


def _ratio(values: list[float], others: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values) - np.log(others))))


def _draw(found: dict[str, dict[str, list[float]]], counts: list[int], keys: int) -> Figure:
    figure = Figure(figsize=(15, 5), layout="constrained")
    figure.suptitle("Ways to scramble Sobol's sequence")
    panels = figure.subplots(1, 3)
    exact, chance = found["Owen, exact"], 1 / np.sqrt(keys)
    for axes, kind in zip(panels, (*MEANS, "distance"), strict=True):
        for name, (_, drawn) in WAYS.items():
            of_exact = np.array(exact[kind]) if kind in MEANS else 1
            axes.loglog(
                counts,
                np.array(found[name][kind]) / of_exact,
                color=drawn.color,
                marker=drawn.marker,
                ls=drawn.line,
                label=name,
            )
        axes.set_xscale("log", base=2)
        axes.set_xlabel("points n")
        axes.grid(alpha=0.3)
        if kind in MEANS:
            axes.axhspan(1 - chance, 1 + chance, color="0.9", zorder=0)
            axes.set(title=NAMES[kind], ylabel="RMS error over that of exact Owen scrambling")
        else:
            axes.set(title="mean minimum distance on the torus", ylabel="distance times $\\sqrt{n}$")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(WAYS), frameon=False
    )
    return figure
