"""What ray-traced scenes are made of: motion, shapes, worlds of objects, and what rays hit there.

Objects are shapes in a space of their own with a motion into the world; rays go to that space once for each
object, so that rotation is exact at every time.
"""

from qmcjax.tracing import motion as motion
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
from qmcjax.tracing._object import Object as Object
from qmcjax.tracing._round import Cylinder as Cylinder
from qmcjax.tracing._round import Sphere as Sphere
from qmcjax.tracing._shape import Rays as Rays
from qmcjax.tracing._shape import Shape as Shape
from qmcjax.tracing._triangles import Triangles as Triangles
from qmcjax.tracing._world import World as World
from qmcjax.tracing._world import world as world
