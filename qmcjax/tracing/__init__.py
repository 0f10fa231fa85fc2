"""What ray-traced scenes are made of: motion, shapes, worlds of objects, and what rays hit there.

Objects are shapes in a space of their own with a motion into the world; rays go to that space once for each
object, so that rotation is exact at every time.
"""

from qmcjax.tracing import motion as motion
from qmcjax.tracing import trees as trees
from qmcjax.tracing._bidirectional import Bidirectional as Bidirectional
from qmcjax.tracing._bidirectional import bidirectional as bidirectional
from qmcjax.tracing._camera import Camera as Camera
from qmcjax.tracing._camera import camera as camera
from qmcjax.tracing._direct import DirectLight as DirectLight
from qmcjax.tracing._direct import direct_light as direct_light
from qmcjax.tracing._estimator import Estimator as Estimator
from qmcjax.tracing._factories import box as box
from qmcjax.tracing._factories import cylinder as cylinder
from qmcjax.tracing._factories import disc as disc
from qmcjax.tracing._factories import group as group
from qmcjax.tracing._factories import plane as plane
from qmcjax.tracing._factories import rectangle as rectangle
from qmcjax.tracing._factories import sphere as sphere
from qmcjax.tracing._factories import triangles as triangles
from qmcjax.tracing._flat import Box as Box
from qmcjax.tracing._flat import Disc as Disc
from qmcjax.tracing._flat import Plane as Plane
from qmcjax.tracing._flat import Rectangle as Rectangle
from qmcjax.tracing._hit import Hit as Hit
from qmcjax.tracing._hit import any_hit as any_hit
from qmcjax.tracing._hit import nearest_hit as nearest_hit
from qmcjax.tracing._light_factories import environment as environment
from qmcjax.tracing._light_factories import point_light as point_light
from qmcjax.tracing._light_factories import rectangle_light as rectangle_light
from qmcjax.tracing._light_factories import sphere_light as sphere_light
from qmcjax.tracing._lights import Environment as Environment
from qmcjax.tracing._lights import Light as Light
from qmcjax.tracing._lights import PointLight as PointLight
from qmcjax.tracing._lights import RectangleLight as RectangleLight
from qmcjax.tracing._lights import SphereLight as SphereLight
from qmcjax.tracing._materials import Diffuse as Diffuse
from qmcjax.tracing._materials import Emitter as Emitter
from qmcjax.tracing._materials import Glossy as Glossy
from qmcjax.tracing._materials import Material as Material
from qmcjax.tracing._materials import Mirror as Mirror
from qmcjax.tracing._materials import Surface as Surface
from qmcjax.tracing._materials import diffuse as diffuse
from qmcjax.tracing._materials import emitter as emitter
from qmcjax.tracing._materials import glossy as glossy
from qmcjax.tracing._materials import mirror as mirror
from qmcjax.tracing._object import Object as Object
from qmcjax.tracing._paths import PathTracing as PathTracing
from qmcjax.tracing._paths import path_tracing as path_tracing
from qmcjax.tracing._round import Cylinder as Cylinder
from qmcjax.tracing._round import Sphere as Sphere
from qmcjax.tracing._shape import Rays as Rays
from qmcjax.tracing._shape import Shape as Shape
from qmcjax.tracing._textures import Pattern as Pattern
from qmcjax.tracing._textures import Stripes as Stripes
from qmcjax.tracing._textures import checker as checker
from qmcjax.tracing._textures import stripes as stripes
from qmcjax.tracing._triangles import Triangles as Triangles
from qmcjax.tracing._visible import VisibleIntervals as VisibleIntervals
from qmcjax.tracing._visible import visible_intervals as visible_intervals
from qmcjax.tracing._world import World as World
from qmcjax.tracing._world import world as world
