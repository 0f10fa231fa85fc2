"""Nets and what they look like: intervals, blocks, shears, scramblings (thesis Fig. 5.1 to 5.23)."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures import plot
from figures.shared.sheets import point_plots
from figures.thesis.chapter_5.frames import draw_sets
from qmcjax import sequences

M_5_2 = 4


def thesis_5_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw a (0,4,2)-net over every kind of elementary interval."""
    points = point_plots.block(sequences.larcher_pillichshammer_net(M_5_2), 2**M_5_2)
    figure, axes = point_plots.panels(
        M_5_2 + 1,
        "A net has exactly one point in each elementary interval\n"
        "thesis, Fig. 5.2; a (0,4,2)-net and all kinds of elementary intervals of area 1/16",
    )
    for i, panel in enumerate(axes):
        point_plots.grid(panel, 2 ** (M_5_2 - i), 2**i)
        point_plots.scatter(panel, points, f"{_part(M_5_2 - i)} wide, {_part(i)} high")
    return figure, {
        "measured": {"t": analysis.t_value(points)},
        "claims": {
            "exactly one point in each elementary interval": point_plots.holds_one_each(points, M_5_2)
        },
        "note": "The net of the thesis's figure is not named; this is the Larcher-Pillichshammer net.",
    }


def _part(halvings: int) -> str:
    return f"1/{2**halvings}" if halvings else "1"


M_5_3, BLOCKS = 6, 4


def thesis_5_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four blocks of 64 points, and all of them together."""
    seq = sequences.sobol(2)
    blocks = [point_plots.block(seq, 2**M_5_3, k * 2**M_5_3) for k in range(BLOCKS)]
    # In the middle of the cells of all points.
    drawn = [points + 0.5 / (BLOCKS * 2**M_5_3) for points in blocks]
    figure = draw_sets(
        "Blocks of the Sobol' (0,2)-sequence are nets, and so is their union\nthesis, Fig. 5.3",
        {f"points {k * 2**M_5_3} to {(k + 1) * 2**M_5_3 - 1}": points for k, points in enumerate(drawn)},
        f"all {BLOCKS * 2**M_5_3} points",
        (2 ** (M_5_3 // 2), 2 ** (M_5_3 // 2 + 1)),
    )
    together = np.concatenate(blocks)
    return figure, {
        "measured": {
            "t of the blocks": [analysis.t_value(points) for points in blocks],
            "t of their union": analysis.t_value(together),
        },
        "claims": {
            "each block is a (0,6,2)-net": {
                f"block {k}": point_plots.holds_one_each(points, M_5_3) for k, points in enumerate(blocks)
            },
            "their union is a (0,8,2)-net": point_plots.holds_one_each(together, M_5_3 + 2),
        },
    }


PRINTED_5_3_2 = {2: 6, 3: 12, 4: 38, 5: 90}
DECIMALS = {2: 0.6123724358, 3: 0.4330127019, 4: 0.3852758752, 5: 0.2964635307}
PLANES = ((0, 1), (0, 2), (1, 2))


def thesis_5_3_2(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the three projections of each net."""
    figure, axes = point_plots.panels(
        12,
        "Permutation nets in three dimensions have the printed distances\n"
        "thesis, Sect. 5.3.2; $P_2$ to $P_5$ in the three planes, and their squared distances",
        columns=4,
        shape=0.95,
    )
    measured: dict[str, dict] = {}
    planar: dict[str, dict[str, bool]] = {}
    for column, m in enumerate(PRINTED_5_3_2):
        net = sequences.permutation_net_3d(m)
        words = point_plots.words(net, m)
        points = words / 2**m
        squared = analysis.squared_min_distance(words, side=2**m)
        planar[f"P_{m}"] = {
            f"{'xyz'[a]}{'xyz'[b]}": point_plots.holds_one_each(points[:, [a, b]], m) for a, b in PLANES
        }
        measured[f"P_{m}"] = {"squared distance": squared, "t": analysis.t_value(points)}
        for row, (a, b) in enumerate(PLANES):
            panel = axes[len(PRINTED_5_3_2) * row + column]
            point_plots.grid(panel, 2**m, 2**m)
            head = "" if row else f"$P_{m}$: {squared} / $2^{{{2 * m}}}$\n"
            title = f"{head}{'xyz'[a]} and {'xyz'[b]}"
            point_plots.scatter(panel, (words[:, [a, b]] + 0.5) / 2**m, title, ms=3)
    return figure, {
        "measured": measured,
        "printed": {
            f"P_{m}": {"squared distance": value, "decimals": DECIMALS[m]}
            for m, value in PRINTED_5_3_2.items()
        },
        "claims": {
            "they have the printed distances": {
                f"P_{m}": measured[f"P_{m}"]["squared distance"] == value
                for m, value in PRINTED_5_3_2.items()
            },
            "the printed decimals are those of the roots": {
                f"P_{m}": abs(DECIMALS[m] - value**0.5 / 2**m) < 0.51e-10
                for m, value in PRINTED_5_3_2.items()
            },
            "they are (0,m,3)-nets": {name: of["t"] == 0 for name, of in measured.items()},
            "all projections are (0,m,2)-nets": {name: all(of.values()) for name, of in planar.items()},
        },
        "note": "Points are drawn in the centres of their cells. Two of the printed decimals have a wrong "
        "tenth digit: sqrt(6)/4 = 0.6123724357, sqrt(90)/32 = 0.2964635306.",
    }


SIZES = (3, 5, 7, 4, 6, 8)
PRINTED_5_16 = {3: 8, 5: 32, 7: 128, 4: 13, 6: 53, 8: 241}


def thesis_5_16(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the nets that the thesis draws."""
    figure, axes = point_plots.panels(
        6,
        "Permutation nets have the squared distances that are printed\n"
        "thesis, Fig. 5.13 and 5.16; odd and even m",
        columns=3,
    )
    measured: dict[str, int] = {}
    with_origin = {}
    for m, panel in zip(SIZES, axes, strict=True):
        net = sequences.permutation_net(m)
        words = point_plots.words(net, m)
        shear = 0 if m % 2 else 2 ** (m - 2)
        measured[str(m)] = analysis.squared_min_distance(words, side=2**m, shear=shear)
        with_origin[f"m = {m}"] = bool((words == 0).all(axis=1).any())
        point_plots.grid(panel, 2 ** (m // 2), 2 ** (m // 2))
        point_plots.scatter(
            panel,
            point_plots.block(net, 2**m),
            f"m = {m}, squared distance {measured[str(m)]} / $2^{{{2 * m}}}$",
        )
    return figure, {
        "measured": {"squared distance on the integer grid": measured},
        "printed": {"squared distance on the integer grid": {str(m): PRINTED_5_16[m] for m in SIZES}},
        "claims": {
            "squared distances are those of Table 5.1": {
                f"m = {m}": measured[str(m)] == PRINTED_5_16[m] for m in SIZES
            },
            "for even m no matrices generate them: the point (0, 0) is missing": {
                name: not found for name, found in with_origin.items() if int(name[-1]) % 2 == 0
            },
        },
        "note": "Even m with the sheared tiling.",
    }


M_5_20, TILES = 6, 4


def thesis_5_20(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw the sheared tiling, and the same points as pixels with wrapped copies of one pattern."""
    side = 2**M_5_20
    net = point_plots.words(sequences.permutation_net(M_5_20), M_5_20)
    index = jnp.arange(side, dtype=jnp.uint32)
    in_row = [
        np.asarray(sequences.permutation_net_in_row(M_5_20, row, index) >> np.uint32(32 - M_5_20)).astype(
            np.int64
        )
        for row in range(TILES)
    ]
    pattern = [
        points + np.array([column, row]) * side
        for row, points in enumerate(in_row)
        for column in range(TILES)
    ]
    whole = np.concatenate(pattern)
    figure, axes = point_plots.panels(
        2,
        "A sheared tiling repeats a net without reducing its minimum distance\n"
        "thesis, Fig. 5.18 to 5.20; m = 6, cut into pixels",
    )
    for k, part in enumerate(pattern):
        point_plots.scatter(
            axes[0], part / (side * TILES), "4 x 4 pixels, alike in each row", ms=2.5, color=f"C{k // TILES}"
        )
    point_plots.grid(axes[0], TILES, TILES)
    point_plots.grid(axes[1], TILES, TILES, color="0.9")
    point_plots.scatter(axes[1], whole / (side * TILES), "tiles, each row moved by a quarter", ms=2.5)
    for row in range(TILES):
        left = np.arange(-1, TILES + 1) + row % 4 / 4
        axes[1].vlines(left / TILES, row / TILES, (row + 1) / TILES, color="C1", lw=0.8)
        axes[1].axhline(row / TILES, color="C1", lw=0.8)
    patterned, sheared, alike = (
        analysis.squared_min_distance(points, side=period, shear=shear)
        for points, period, shear in ((whole, side * TILES, 0), (net, side, side // 4), (net, side, 0))
    )
    measured = {
        "squared distance of the 4 x 4 pixels, tiled regularly": patterned,
        "squared distance of the net, tiled with shear": sheared,
        "squared distance of the net, tiled regularly": alike,
    }
    return figure, {
        "measured": measured,
        "claims": {
            "the 4 x 4 pixels can be tiled regularly without a decrease in minimum distance": (
                patterned == sheared
            ),
            "the same pattern in each pixel would have less": alike < sheared,
        },
    }


M_5_23, KEYS = 6, 4


def thesis_5_23(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Scramble the (0,6,2)-permutation net with four keys."""
    net = sequences.permutation_net(M_5_23)
    unscrambled = point_plots.block(net, 2**M_5_23)
    scrambled = {
        f"key {key}": point_plots.block(sequences.owen_exact(net, key), 2**M_5_23) for key in range(KEYS)
    }
    rotated = {
        f"key {key}": point_plots.block(sequences.rotate(net, jax.random.key(key)), 2**M_5_23)
        for key in range(KEYS)
    }
    plain, sheared = (analysis.min_distance(unscrambled, shear=shear) for shear in (0.0, 0.25))
    distances = {
        way: {key: analysis.min_distance(points) for key, points in sets.items()}
        for way, sets in (("scrambled", scrambled), ("rotated", rotated))
    }
    is_net = {key: point_plots.holds_one_each(points, M_5_23) for key, points in scrambled.items()}
    # The thesis draws four scramblings, and no rotation.
    sets = {"not scrambled": unscrambled} | {f"Owen, {key}": points for key, points in scrambled.items()}
    figure = _draw(sets | {"rotated": rotated["key 0"]})
    return figure, {
        "measured": {
            **{key: {"minimum distance": distance} for key, distance in distances["scrambled"].items()},
            "unscrambled": {"minimum distance": plain, "minimum distance, sheared tiling": sheared},
            "rotated": distances["rotated"],
        },
        "claims": {
            "scrambled points are stratified as a (0,6,2)-net": is_net,
            "the minimum distance does not hold any more": {
                key: distance < plain for key, distance in distances["scrambled"].items()
            },
            "a rotation keeps the toroidal minimum distance": {
                key: bool(np.isclose(distance, plain, rtol=1e-9))
                for key, distance in distances["rotated"].items()
            },
            "a rotation violates the net property": {
                key: not point_plots.holds_one_each(points, M_5_23) for key, points in rotated.items()
            },
        },
        "note": "Distances are toroidal, but for that of the sheared tiling. Rotations are Cranley "
        "and Patterson's; 'intervals' are the elementary ones of area 1/64, of all shapes.",
    }


def _draw(sets: dict[str, NDArray]) -> Figure:
    title = (
        "Owen scrambling keeps the net but not its distance, a rotation the reverse\n"
        "thesis, Fig. 5.23; the (0,6,2)-permutation net"
    )
    figure, axes = point_plots.panels(len(sets), title, columns=3)
    for panel, (name, points) in zip(axes, sets.items(), strict=True):
        distance = analysis.min_distance(points)
        text = f"{name}: distance {distance:.4f},\none point in {100 * _occupied(points):.0f} % of intervals"
        point_plots.grid(panel, 2 ** (M_5_23 // 2), 2 ** (M_5_23 // 2))
        point_plots.scatter(panel, points, text, color=plot.style("permutation").color)
    return figure


def _occupied(points: NDArray[np.float64]) -> float:
    """Return the part of the elementary intervals of area 2**-M that hold one point."""
    return float(
        np.mean([(analysis.interval_counts(points, (i, M_5_23 - i)) == 1).mean() for i in range(M_5_23 + 1)])
    )
