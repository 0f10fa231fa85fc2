"""Scenes: functions on the unit cube with named dimensions, and exact images of them.

Arguments known before tracing are checked: a TypeError or ValueError names the argument, the requirement and
the value.
"""

import importlib
import typing

from qmcjax.scenes._ball import Ball as Ball
from qmcjax.scenes._ball import ball as ball
from qmcjax.scenes._base import Scene as Scene
from qmcjax.scenes._base import as_scene as as_scene
from qmcjax.scenes._base import function as function
from qmcjax.scenes._blurred_edges import DefocusedEdge as DefocusedEdge
from qmcjax.scenes._blurred_edges import MovingEdge as MovingEdge
from qmcjax.scenes._blurred_edges import SoftShadow as SoftShadow
from qmcjax.scenes._blurred_edges import defocused_edge as defocused_edge
from qmcjax.scenes._blurred_edges import moving_edge as moving_edge
from qmcjax.scenes._blurred_edges import soft_shadow as soft_shadow
from qmcjax.scenes._checkerboards import Checkerboard as Checkerboard
from qmcjax.scenes._checkerboards import FlatCheckerboard as FlatCheckerboard
from qmcjax.scenes._checkerboards import checkerboard as checkerboard
from qmcjax.scenes._checkerboards import flat_checkerboard as flat_checkerboard
from qmcjax.scenes._discs import BlinkingDisc as BlinkingDisc
from qmcjax.scenes._discs import Disc as Disc
from qmcjax.scenes._discs import blinking_disc as blinking_disc
from qmcjax.scenes._discs import disc as disc
from qmcjax.scenes._genz import Genz as Genz
from qmcjax.scenes._genz import genz as genz
from qmcjax.scenes._half_planes import Line as Line
from qmcjax.scenes._half_planes import Staircase as Staircase
from qmcjax.scenes._half_planes import Step as Step
from qmcjax.scenes._half_planes import line as line
from qmcjax.scenes._half_planes import staircase as staircase
from qmcjax.scenes._half_planes import step as step
from qmcjax.scenes._many_dimensions import Heaviside as Heaviside
from qmcjax.scenes._many_dimensions import PathToy as PathToy
from qmcjax.scenes._many_dimensions import heaviside as heaviside
from qmcjax.scenes._many_dimensions import path_toy as path_toy
from qmcjax.scenes._smooth import Gaussian as Gaussian
from qmcjax.scenes._smooth import Product as Product
from qmcjax.scenes._smooth import Ramp as Ramp
from qmcjax.scenes._smooth import ZonePlate as ZonePlate
from qmcjax.scenes._smooth import gaussian as gaussian
from qmcjax.scenes._smooth import product as product
from qmcjax.scenes._smooth import ramp as ramp
from qmcjax.scenes._smooth import zone_plate as zone_plate
from qmcjax.scenes._triangle import Triangle as Triangle
from qmcjax.scenes._triangle import triangle as triangle

if typing.TYPE_CHECKING:
    from qmcjax.scenes import traced as traced
    from qmcjax.scenes.traced import Traced as Traced
    from qmcjax.scenes.traced import caustic as caustic
    from qmcjax.scenes.traced import cornell_box as cornell_box
    from qmcjax.scenes.traced import defocus as defocus
    from qmcjax.scenes.traced import helicopter as helicopter
    from qmcjax.scenes.traced import interior as interior
    from qmcjax.scenes.traced import moving_triangles as moving_triangles
    from qmcjax.scenes.traced import occluder as occluder
    from qmcjax.scenes.traced import sports as sports
else:
    _TRACED = (
        "Traced",
        "caustic",
        "cornell_box",
        "defocus",
        "helicopter",
        "interior",
        "moving_triangles",
        "occluder",
        "sports",
    )

    def __getattr__(name: str) -> typing.Any:
        """Import ray-traced scenes at first use: with `qmcjax.tracing` they are half of the library."""
        if name not in ("traced", *_TRACED):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        module = importlib.import_module("qmcjax.scenes.traced")
        globals().update({each: getattr(module, each) for each in _TRACED}, traced=module)
        return globals()[name]

    def __dir__() -> list[str]:
        return sorted({*globals(), "traced", *_TRACED} - {"importlib", "typing"})
