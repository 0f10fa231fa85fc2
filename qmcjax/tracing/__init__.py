"""The parts of ray-traced scenes: motion, shapes, worlds of objects, lights, cameras and ray queries.

Objects are shapes in object space with a motion to world space. Each ray is transformed to object space, so
rotation is exact at every time.

Arguments known before tracing are checked: a TypeError or ValueError names the argument, the requirement and
the value.
"""

from qmcjax.tracing import motion as motion
from qmcjax.tracing._estimators.analytic import AnalyticVisibility as AnalyticVisibility
from qmcjax.tracing._estimators.analytic import analytic_visibility as analytic_visibility
from qmcjax.tracing._estimators.bidirectional import Bidirectional as Bidirectional
from qmcjax.tracing._estimators.bidirectional import bidirectional as bidirectional
from qmcjax.tracing._estimators.estimator import DirectLight as DirectLight
from qmcjax.tracing._estimators.estimator import Estimator as Estimator
from qmcjax.tracing._estimators.estimator import direct_light as direct_light
from qmcjax.tracing._estimators.paths import PathTracing as PathTracing
from qmcjax.tracing._estimators.paths import path_tracing as path_tracing
from qmcjax.tracing._estimators.resampled import ResampledLight as ResampledLight
from qmcjax.tracing._estimators.resampled import resampled_light as resampled_light
from qmcjax.tracing._intervals.visible import VisibleIntervals as VisibleIntervals
from qmcjax.tracing._intervals.visible import visible_intervals as visible_intervals
from qmcjax.tracing._shapes.object import Object as Object
from qmcjax.tracing._shapes.object import Rays as Rays
from qmcjax.tracing._shapes.object import Shape as Shape
from qmcjax.tracing._shapes.primitives import Box as Box
from qmcjax.tracing._shapes.primitives import Cylinder as Cylinder
from qmcjax.tracing._shapes.primitives import Disc as Disc
from qmcjax.tracing._shapes.primitives import Plane as Plane
from qmcjax.tracing._shapes.primitives import Rectangle as Rectangle
from qmcjax.tracing._shapes.primitives import Sphere as Sphere
from qmcjax.tracing._shapes.triangles import Triangles as Triangles
from qmcjax.tracing._world.factories import box as box
from qmcjax.tracing._world.factories import cylinder as cylinder
from qmcjax.tracing._world.factories import disc as disc
from qmcjax.tracing._world.factories import group as group
from qmcjax.tracing._world.factories import plane as plane
from qmcjax.tracing._world.factories import rectangle as rectangle
from qmcjax.tracing._world.factories import sphere as sphere
from qmcjax.tracing._world.factories import triangles as triangles
from qmcjax.tracing._world.lights import Environment as Environment
from qmcjax.tracing._world.lights import Light as Light
from qmcjax.tracing._world.lights import PointLight as PointLight
from qmcjax.tracing._world.lights import RectangleLight as RectangleLight
from qmcjax.tracing._world.lights import SphereLight as SphereLight
from qmcjax.tracing._world.lights import environment as environment
from qmcjax.tracing._world.lights import point_light as point_light
from qmcjax.tracing._world.lights import rectangle_light as rectangle_light
from qmcjax.tracing._world.lights import sphere_light as sphere_light
from qmcjax.tracing._world.materials import Diffuse as Diffuse
from qmcjax.tracing._world.materials import Emitter as Emitter
from qmcjax.tracing._world.materials import Glossy as Glossy
from qmcjax.tracing._world.materials import Material as Material
from qmcjax.tracing._world.materials import Mirror as Mirror
from qmcjax.tracing._world.materials import Pattern as Pattern
from qmcjax.tracing._world.materials import Stripes as Stripes
from qmcjax.tracing._world.materials import Surface as Surface
from qmcjax.tracing._world.materials import checker as checker
from qmcjax.tracing._world.materials import diffuse as diffuse
from qmcjax.tracing._world.materials import emitter as emitter
from qmcjax.tracing._world.materials import glossy as glossy
from qmcjax.tracing._world.materials import mirror as mirror
from qmcjax.tracing._world.materials import stripes as stripes
from qmcjax.tracing._world.world import Camera as Camera
from qmcjax.tracing._world.world import World as World
from qmcjax.tracing._world.world import camera as camera
from qmcjax.tracing._world.world import world as world
from qmcjax.tracing.search.hits import Hit as Hit
from qmcjax.tracing.search.hits import any_hit as any_hit
from qmcjax.tracing.search.hits import nearest_hit as nearest_hit
