"""Errors of single precision: points, offsets in pixels, sums, frequencies, dimensions."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

KEY = 1
UNIT = 2.0**-24
"""The spacing of float32 coordinates."""

Curves = dict[str, dict[float, float]]
"""Errors over what is stressed, by method."""

NOTE = (
    "Largest errors of {count} random cases (frequencies: 64 times as many), from fixed keys. Points: "
    "against exact fractions, in units of 2^-24, the spacing of float32 coordinates; the textbook loop "
    "adds digit / base^k in float32. Offsets: of a net over the whole screen, against its 32-bit words; "
    "the textbook way is x width - floor(x width) in float32. For all samplers, scenes get the position "
    "on the screen as one float32, to 2^-24 of the screen. Sums: means of the Gaussian bump, in units "
    "in the last place, against the sum of the same values in float64; and against points, values and "
    "sums in float64, which also includes the effect of rounded positions. Frequencies: values of the "
    "zone plate against extended precision at the same float32 points; the phase f (x^2 + y^2) has a "
    "rounding error of about f 2^-24, which no sine can mend; dtype=float64 does. Dimensions: relative "
    "error, in units of 2^-24, of products of d factors."
)


def points(count: int) -> Curves:
    """Return errors of coordinates of indices up to 2^32 - 1."""
    sobol = sequences.sobol(2)
    families: dict[str, tuple[sequences.Sequence, Callable[[int], Fraction]]] = {
        "Sobol', second component": (sobol, lambda i: Fraction(int(sobol.bits(jnp.uint32(i))[1]), 2**32)),
        "Halton, base 3": (sequences.halton(2), lambda i: _radical_inverse(i, 3)),
        "Halton, base 13": (sequences.halton(6), lambda i: _radical_inverse(i, 13)),
    }
    curves: Curves = {name: {} for name in (*families, "textbook loop, base 3")}
    rng = np.random.default_rng(KEY)
    for k in range(4, 33, 4):
        chosen = rng.integers(2 ** (k - 1), 2**k, count, dtype=np.uint32)
        chosen[0] = 2**k - 1
        for name, (sequence, exact) in families.items():
            given = np.asarray(sequence(jnp.asarray(chosen), (sequence.dims - 1,)))[:, 0]
            curves[name][2**k] = _largest(given, [exact(int(i)) for i in chosen])
        loop = [_textbook(int(i), 3) for i in chosen]
        exact_loop = [_radical_inverse(int(i), 3) for i in chosen]
        curves["textbook loop, base 3"][2**k] = _largest(np.array(loop), exact_loop)
    return curves


def _radical_inverse(index: int, base: int) -> Fraction:
    inverse, scale = 0, 1
    while index:
        index, digit = divmod(index, base)
        inverse, scale = inverse * base + digit, scale * base
    return Fraction(inverse, scale)


def _textbook(index: int, base: int) -> np.float32:
    value, place = np.float32(0), np.float32(1)
    while index:
        index, digit = divmod(index, base)
        place = np.float32(place / np.float32(base))
        value = np.float32(value + np.float32(digit) * place)
    return value


def _largest(given: NDArray, exact: list[Fraction]) -> float:
    return max(abs(float(Fraction(float(g)) - e)) for g, e in zip(given, exact, strict=True)) / UNIT


def offsets(count: int) -> Curves:
    """Return errors of the first coordinate inside a pixel, for a net over the screen."""
    curves: Curves = {"on integers": {}, "textbook, float32": {}}
    rng = np.random.default_rng(KEY)
    net = sequences.larcher_pillichshammer_net(32)
    for k in range(4, 17, 2):
        side = 2**k
        x, y = (jnp.asarray(rng.integers(0, side, count, dtype=np.uint32)) for _ in range(2))
        sampler = samplers.full_screen(net, side, side)
        zero = jnp.zeros(count, jnp.uint32)
        index = net.index_in_cell(x, y, k, zero)
        words = np.asarray(net.bits(index))[:, 0].astype(np.uint64)
        exact = ((words << np.uint64(k)) & np.uint64(2**32 - 1)).astype(np.float64) / 2**32
        given = np.asarray(sampler(x, y, zero, (0,)), np.float64)[:, 0]
        whole = np.asarray(net(index, (0,)))[:, 0] * np.float32(side)
        curves["on integers"][side] = float(np.abs(np.asarray(given, np.float64) - exact).max() / UNIT)
        textbook = (whole - np.floor(whole)).astype(np.float64)
        curves["textbook, float32"][side] = float(np.abs(textbook - exact).max() / UNIT)
    return curves


def sums(top: int) -> Curves:
    """Return errors of means of up to 2^top samples in each of four pixels."""
    scene = scenes.gaussian()
    ours, wide = "render, float32", "render, float32, against all in float64"
    curves: Curves = {name: {} for name in ("naive", "pairwise", "compensated", ours, wide)}
    for k in range(4, top + 1, 2):
        spp = 2**k
        sampler = samplers.contiguous(orders.hilbert(2, 2), sequences.owen(sequences.sobol(2), KEY), spp)
        values, ways = _sums(scene, sampler, jnp.arange(spp, dtype=jnp.uint32))
        exact = np.asarray(values, np.float64).mean(axis=0)
        ulp = np.spacing(exact.astype(np.float32)).astype(np.float64)
        image = np.asarray(qj.render(scene, sampler, 2, 2, spp), np.float64)
        for name, mean in (ways | {ours: image}).items():
            curves[name][spp] = float(np.abs((np.asarray(mean, np.float64) - exact) / ulp).max())
        in_float64 = np.asarray(qj.render(scene, sampler, 2, 2, spp, dtype=jnp.float64))
        curves[wide][spp] = float(np.abs((image - in_float64) / ulp).max())
    return curves


@jax.jit
def _sums(scene: Any, sampler: Any, samples: Any) -> tuple[Any, dict[str, Any]]:
    """Return values in float32, and their means, added in three ways."""
    y, x = (i[..., None].astype(jnp.uint32) for i in jnp.indices((2, 2)))
    inside = sampler(x, y, samples)
    corner = jnp.concatenate([x, y], axis=-1).astype(jnp.float32)
    values = jnp.moveaxis(scene((inside + corner[:, :, None, :]) * np.float32(0.5)), -1, 0)
    spp = np.float32(len(samples))

    def compensated(state: Any, value: Any) -> tuple[Any, None]:
        total, excess = state
        value = value - excess
        new = total + value
        return (new, (new - total) - value), None

    zero = jnp.zeros((2, 2), jnp.float32)
    naive, _ = jax.lax.scan(lambda total, value: (total + value, None), zero, values)
    kahan, _ = jax.lax.scan(compensated, (zero, zero), values)
    tree = values
    while len(tree) > 1:
        tree = tree[::2] + tree[1::2]
    return values, {
        "naive": naive / spp,
        "pairwise": tree[0] / spp,
        "compensated": (kahan[0] - kahan[1]) / spp,
    }


def frequencies(count: int) -> Curves:
    """Return errors of values of the zone plate."""
    curves: Curves = {"scene, float32": {}, "sine of radians, float32": {}, "scene, float64": {}}
    drawn = np.random.default_rng(KEY).random((64 * count, 2)).astype(np.float32)
    x, y = drawn.astype(np.longdouble).T
    for frequency in (10**k for k in range(7)):
        exact = 0.5 + 0.5 * np.sin(np.longdouble(frequency) * (x * x + y * y))
        scene = scenes.zone_plate(float(frequency))
        given = {"scene, float32": np.asarray(scene(jnp.asarray(drawn)))}
        with jax.enable_x64(True):
            given["scene, float64"] = np.asarray(scene(jnp.asarray(drawn, jnp.float64)))
        squares = drawn[:, 0] * drawn[:, 0] + drawn[:, 1] * drawn[:, 1]
        half, sine = np.float32(0.5), np.sin(np.float32(frequency) * squares)
        given["sine of radians, float32"] = half + half * sine
        for name, values in given.items():
            curves[name][frequency] = float(np.abs(values - exact).max())
    return curves


def dimensions(count: int) -> Curves:
    """Return errors of products of up to 1024 factors, and of Sobol' coordinates."""
    curves: Curves = {"product, float32": {}, "coordinates, float32": {}}
    for k in range(1, 11):
        dims = 2**k
        sequence = sequences.sobol(dims)
        index = jnp.asarray(np.random.default_rng(KEY).integers(0, 2**32, count, dtype=np.uint32))
        exact = np.asarray(sequence.bits(index)).astype(np.float64) / 2**32
        given = sequence(index)
        product = np.asarray(jnp.prod(1 + 0.5 * (given - 0.5), axis=-1), np.float64)
        wide = np.asarray(given, np.float64)
        relative = product / np.prod(1 + 0.5 * (wide - 0.5), axis=-1)
        curves["product, float32"][dims] = float(np.abs(relative - 1).max() / UNIT)
        curves["coordinates, float32"][dims] = float(np.abs(wide - exact).max() / UNIT)
    return curves
