"""Scenes that share tests, by the kind of their reference."""

import jax
import numpy as np

from qmcjax import scenes

evaluated = jax.jit(lambda scene, point: scene(point))
varied = jax.jit(lambda scene, low, high: scene.varies(low, high))

PLANE = {
    "step": scenes.step(),
    "step upwards": scenes.step(angle=-2.1, offset=-0.3),
    "step along x": scenes.step(angle=0.0, offset=0.37),
    "step almost along y": scenes.step(angle=np.pi / 2, offset=0.61),
    "staircase": scenes.staircase(),
    "line": scenes.line(),
    "thin line": scenes.line(angle=2.0, offset=0.1, thickness=1e-4),
    "disc": scenes.disc((0.45, 0.56), 0.31),
    "cut disc": scenes.disc((1.03, 0.2), 0.4),
    "tiny disc": scenes.disc((0.413, 0.22), 1e-3),
    "huge disc": scenes.disc((70.4, 70.3), 99.0),
    "triangle": scenes.triangle(),
    "cut triangle": scenes.triangle([(1.2, 0.4), (0.15, -0.2), (0.35, 0.85)]),
    "sliver": scenes.triangle([(0.1, 0.2), (0.1, 0.2001), (0.9, 0.77)]),
    "flat board": scenes.flat_checkerboard(),
    "flat board, straight": scenes.flat_checkerboard(7.3, 0.0),
    "flat board, few": scenes.flat_checkerboard(0.9, -2.0),
    "flat board, many": scenes.flat_checkerboard(30.0, 1.2),
    "heaviside(2)": scenes.heaviside(2, 0.93),
    "heaviside(3)": scenes.heaviside(3),
    "heaviside(8)": scenes.heaviside(8, 3.3),
}

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
    "gaussian": scenes.gaussian(),
    "gaussian, narrow": scenes.gaussian((0.1, 0.5), 0.02),
    "product": scenes.product(),
    **{f"genz, {family}": scenes.genz(family, 4, A, U) for family in FAMILIES},
    "ramp(0)": scenes.ramp(0),
    "ramp(1)": scenes.ramp(1),
    "ramp": scenes.ramp(),
    "path_toy": scenes.path_toy(3),
    "path_toy, no roulette": scenes.path_toy(2, 0.7, None, 2.0),
}

PERSPECTIVE = {
    **{f"checkerboard({n})": scenes.checkerboard(n) for n in (8.0, 3.3, 0.37, 1e4)},
    **{f"zone_plate({n})": scenes.zone_plate(n) for n in (100.0, 17.3, 1e5)},
}

EVERY = PLANE | MOTION | SMOOTH | PERSPECTIVE
