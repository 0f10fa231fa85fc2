"""Motion as pure functions of time: curves, rotations, matrices, and their bounds (thesis, Chapter 2).

A path maps times, shape (...), to points, shape (..., d); a rotation path maps them to unit quaternions,
shape (..., 4), with the scalar last.
"""

from qmcjax.tracing.motion._affine import Affine as Affine
from qmcjax.tracing.motion._affine import affine as affine
from qmcjax.tracing.motion._arc_length import ArcLength as ArcLength
from qmcjax.tracing.motion._nurbs import Nurbs as Nurbs
from qmcjax.tracing.motion._nurbs import nurbs as nurbs
from qmcjax.tracing.motion._paths import LinearSegments as LinearSegments
from qmcjax.tracing.motion._paths import approximated as approximated
from qmcjax.tracing.motion._paths import linear_segments as linear_segments
from qmcjax.tracing.motion._rotations import RotationSpline as RotationSpline
from qmcjax.tracing.motion._rotations import conjugate as conjugate
from qmcjax.tracing.motion._rotations import multiply as multiply
from qmcjax.tracing.motion._rotations import quaternion as quaternion
from qmcjax.tracing.motion._rotations import rotate as rotate
from qmcjax.tracing.motion._rotations import rotation_box as rotation_box
from qmcjax.tracing.motion._rotations import rotation_matrix as rotation_matrix
from qmcjax.tracing.motion._rotations import rotation_spline as rotation_spline
from qmcjax.tracing.motion._rotations import slerp as slerp
from qmcjax.tracing.motion.evaluation import Straightened as Straightened
from qmcjax.tracing.motion.evaluation import straightened as straightened
