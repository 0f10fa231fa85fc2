"""Scenes that share tests, by the kind of their reference, and their definitions."""

import math
from fractions import Fraction
from functools import cache

import jax
import numpy as np

from qmcjax import scenes

evaluated = jax.jit(lambda scene, point: scene(point))


@cache
def cosine_and_sine(angle, digits):
    """Return both to a number of decimal digits, as fractions, by Taylor series."""
    sums, term, k = [Fraction(0), Fraction(0)], Fraction(1), 0
    while abs(term) > Fraction(1, 10**digits):
        sums[k % 2] += term * (-1) ** (k // 2)
        k += 1
        term *= Fraction(angle) / k
    return [Fraction(round(total * 10**digits), 10**digits) for total in sums]


varied = jax.jit(lambda scene, low, high: scene.varies(low, high))


def mixed(scene, image, bound):
    """Return which pixels are not 0, 1 or a stair for certain, by their means: those hold an edge."""
    levels = len(scene.offsets) if isinstance(scene, scenes.Staircase) else 1
    return abs(levels * image - np.rint(levels * image)) > 2 * levels * bound


PLANE = {
    "step": scenes.step(), "step upwards": scenes.step(angle=-2.1, offset=-0.3),
    "step along x": scenes.step(angle=0.0, offset=0.37),
    "step almost along y": scenes.step(angle=np.pi / 2, offset=0.61), "staircase": scenes.staircase(),
    "line": scenes.line(), "thin line": scenes.line(angle=2.0, offset=0.1, thickness=1e-4),
    "disc": scenes.disc((0.45, 0.56), 0.31), "cut disc": scenes.disc((1.03, 0.2), 0.4),
    "tiny disc": scenes.disc((0.413, 0.22), 1e-3), "huge disc": scenes.disc((70.4, 70.3), 99.0),
    "triangle": scenes.triangle(), "cut triangle": scenes.triangle([(1.2, 0.4), (0.15, -0.2), (0.35, 0.85)]),
    "sliver": scenes.triangle([(0.1, 0.2), (0.1, 0.2001), (0.9, 0.77)]),
    "flat board": scenes.flat_checkerboard(), "flat board, straight": scenes.flat_checkerboard(7.3, 0.0),
    "flat board, few": scenes.flat_checkerboard(0.9, -2.0),
    "flat board, many": scenes.flat_checkerboard(30.0, 1.2), "heaviside(2)": scenes.heaviside(2, 0.93),
    "heaviside(3)": scenes.heaviside(3), "heaviside(8)": scenes.heaviside(8, 3.3),
}  # fmt: skip

JUMPING = {"starts": [[0.2, 0.25], [0.75, 0.7], [0.5, 0.1]], "ends": None, "times": [0.3, 0.45]}
MOVING = {"starts": [[0.1, 0.3]], "ends": [[0.9, 0.5]], "times": [], "radius": 0.2}
MOTION = {
    "moving_edge": scenes.moving_edge(),
    "moving_edge, slow": scenes.moving_edge(0.6, -1e-3),
    "moving_edge, still": scenes.moving_edge(0.37, None),
    "blinking_disc": scenes.blinking_disc(),
    "blinking_disc, still": scenes.blinking_disc((0.1, 0.4), 0.35, None),
    "ball": scenes.ball(),
    "ball, jumping": scenes.ball(**JUMPING),
    "ball, one line": scenes.ball(**MOVING),
    "ball, still": scenes.ball([[0.6, 0.6]], None, (), 0.3),
    "defocused_edge": scenes.defocused_edge(),
    "defocused_edge, square": scenes.defocused_edge(2.5, -0.3, 0.1, "square"),
    "defocused_edge, upright": scenes.defocused_edge(0.0, 0.5, 0.02),
    "defocused_edge, still": scenes.defocused_edge(-0.6, 0.2, None),
    "soft_shadow": scenes.soft_shadow(),
    "soft_shadow, upright": scenes.soft_shadow(0.0, 0.4, 0.7, (0.1, 0.5)),
    "soft_shadow, still": scenes.soft_shadow(4.0, -0.7, 0.3, None),
}

FAMILIES = ("oscillatory", "product_peak", "corner_peak", "gaussian", "continuous", "discontinuous")
A, U = np.array([1.0, 3.0, 0.5, 5.0]), np.array([0.3, 0.6, 0.4, 0.2])
SMOOTH = {
    "gaussian": scenes.gaussian(), "gaussian, narrow": scenes.gaussian((0.1, 0.5), 0.02),
    "product": scenes.product(), **{f"genz, {family}": scenes.genz(family, 4, A, U) for family in FAMILIES},
    "ramp(0)": scenes.ramp(0), "ramp(1)": scenes.ramp(1), "ramp": scenes.ramp(),
    "path_toy": scenes.path_toy(3), "path_toy, no roulette": scenes.path_toy(2, 0.7, None, 2.0),
}  # fmt: skip

PERSPECTIVE = {
    **{f"checkerboard({n})": scenes.checkerboard(n) for n in (8.0, 3.3, 0.37, 1e4)},
    **{f"zone_plate({n})": scenes.zone_plate(n) for n in (100.0, 17.3, 1e5)},
}

EVERY = PLANE | MOTION | SMOOTH | PERSPECTIVE


# The scenes by their definitions, in NumPy and float64.


def _below(angle, offset, x, y):
    return np.cos(angle) * x + np.sin(angle) * y < offset


def _distance(scene, p):
    """Return a function that is negative where a scene of motion, lens or light is 1."""
    x, y, *rest = p
    if isinstance(scene, scenes.MovingEdge):
        return x - scene.offset - (scene.velocity * rest[0] if rest else 0)
    if isinstance(scene, scenes.BlinkingDisc):
        inside = np.hypot(x - scene.centre[0], y - scene.centre[1]) - scene.radius
        return np.where((scene.on[0] <= rest[0]) & (rest[0] < scene.on[1]), inside, 1.0) if rest else inside
    if isinstance(scene, scenes.Ball):
        borders = np.array([0.0, *scene.times, 1.0])
        time = rest[0] if rest else np.zeros_like(x)
        line = np.searchsorted(scene.times, time, side="right")
        starts = np.asarray(scene.starts)
        ends = starts if scene.ends is None else np.asarray(scene.ends)
        part = (time - borders[line]) / (borders[line + 1] - borders[line])
        centre = starts[line] + part[..., None] * (ends - starts)[line]
        return np.hypot(x - centre[..., 0], y - centre[..., 1]) - scene.radius
    across, along = np.cos(scene.angle), np.sin(scene.angle)
    if isinstance(scene, scenes.SoftShadow):
        u, v = rest if rest else (0.5, 0.5)
        sides = (0.0, 0.0) if scene.light is None else scene.light
        light = [0.5 + side * (c - 0.5) for side, c in zip(sides, (u, v), strict=True)]
        q = [(1 - scene.height) * p + scene.height * at for p, at in zip((x, y), light, strict=True)]
        return scene.offset - across * q[0] - along * q[1]
    if rest:
        lens = [2 * rest[0] - 1, 2 * rest[1] - 1]
        if scene.aperture == "disc":
            turn = 2 * np.pi * rest[1]
            lens = [np.sqrt(rest[0]) * np.cos(turn), np.sqrt(rest[0]) * np.sin(turn)]
        x, y = x + scene.blur * lens[0], y + scene.blur * lens[1]
    return x * across + y * along - scene.offset


def defined(scene, p):
    """Return the values of a scene by its definition, at points with the coordinates first."""
    x, y = p[:2]
    match scene:
        case scenes.Step():
            return _below(scene.angle, scene.offset, x, y) * 1.0
        case scenes.Staircase():
            return np.mean([_below(scene.angle, offset, x, y) for offset in scene.offsets], axis=0)
        case scenes.Line():
            distance = np.cos(scene.angle) * x + np.sin(scene.angle) * y - scene.offset
            return (abs(distance) < scene.thickness / 2) * 1.0
        case scenes.Disc():
            return (np.hypot(x - scene.centre[0], y - scene.centre[1]) < scene.radius) * 1.0
        case scenes.Triangle():
            base = np.linalg.inv((scene.vertices[1:] - scene.vertices[0]).T)
            shares = (np.moveaxis(p, 0, -1) - scene.vertices[0]) @ base.T
            return ((shares > 0).all(axis=-1) & (shares.sum(axis=-1) < 1)) * 1.0
        case scenes.FlatCheckerboard():
            turned = (x - 0.5 + 1j * (y - 0.5)) * scene.squares * np.exp(-1j * scene.angle)
            return (np.floor(turned.real) + np.floor(turned.imag)) % 2 == 0
        case scenes.Heaviside():
            return (p.sum(axis=0) < scene.threshold) * 1.0
        case scenes.Checkerboard():
            depth = scene.squares / y
            return ((np.floor((x - 0.5) * depth) + np.floor(depth)) % 2 == 0).astype(float)
        case scenes.ZonePlate():
            return (1 + np.sin(scene.frequency * (x**2 + y**2))) / 2
        case scenes.Gaussian():
            x, y = x - scene.centre[0], y - scene.centre[1]
            return np.exp(-(x**2 + y**2) / (2 * scene.width**2))
        case scenes.Product():
            return math.prod((abs(4 * x - 2) + a) / (1 + a) for x, a in zip(p, scene.a, strict=True))
        case scenes.Ramp():
            return p[scene.dimension]
        case scenes.PathToy():
            return _gathered(scene, p)
        case scenes.Genz():
            return _genz(scene, p)
    return (_distance(scene, p) < 0) * 1.0


def _gathered(scene, p):
    value, weight, (x, y), rest = 0.0, 1.0, p[:2], list(p[2:])
    while True:
        value = value + weight * scene.emission * y
        if not rest:
            return value
        weight = weight * scene.albedo * x
        if scene.survival is not None:
            weight = weight * (rest.pop(0) < scene.survival) / scene.survival
        x, y = (x + rest.pop(0)) % 1, (y + rest.pop(0)) % 1


def _genz(scene, p):
    a, u = np.broadcast_arrays(scene.difficulty, scene.shift)
    each = list(zip(p, a, u, strict=True))
    return {
        "oscillatory": lambda: np.cos(2 * np.pi * u[0] + sum(a * x for x, a, _ in each)),
        "product_peak": lambda: math.prod(1 / (a**-2.0 + (x - u) ** 2) for x, a, u in each),
        "corner_peak": lambda: (1 + sum(a * x for x, a, _ in each)) ** -(len(each) + 1.0),
        "gaussian": lambda: np.exp(-sum(a**2 * (x - u) ** 2 for x, a, u in each)),
        "continuous": lambda: np.exp(-sum(a * abs(x - u) for x, a, u in each)),
        "discontinuous": lambda: (p[0] <= u[0]) * (p[1] <= u[1]) * np.exp(sum(a * x for x, a, _ in each)),
    }[scene.family]()
