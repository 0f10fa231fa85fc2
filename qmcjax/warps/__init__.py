"""Maps from the unit cube to other sets: points of a sequence become normals, directions, choices.

Every warp has ``dims``, the number of coordinates of its points, a call from points to values, its
``inverse``, and the ``density`` of the values of uniform points. Low discrepancy survives: the maps are
continuous or monotone, and equal volumes of the cube become sets of equal probability. Warps are pytrees and
work with ``jit``, ``vmap`` and ``grad``.
"""

from qmcjax.warps._base import Warp as Warp
from qmcjax.warps._numbers import discrete as discrete
from qmcjax.warps._numbers import exponential as exponential
from qmcjax.warps._numbers import normal as normal
from qmcjax.warps._numbers import simplex as simplex
from qmcjax.warps._surfaces import disc as disc
from qmcjax.warps._surfaces import hemisphere as hemisphere
from qmcjax.warps._surfaces import sphere as sphere
from qmcjax.warps._surfaces import triangle as triangle
