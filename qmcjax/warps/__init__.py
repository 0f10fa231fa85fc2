"""Maps from the unit cube to other sets: normal variates, directions and discrete choices.

Every warp has ``dims``, the number of coordinates of its points, a call that maps points to values, its
``inverse``, and the ``density`` of the values of uniform points. The maps preserve low discrepancy: they are
continuous or monotone, and map equal volumes of the cube to sets of equal probability. Warps are pytrees and
work with ``jit``, ``vmap`` and ``grad``. :func:`tent` only folds the cube.
"""

from qmcjax.warps._base import Warp as Warp
from qmcjax.warps._numbers import discrete as discrete
from qmcjax.warps._numbers import exponential as exponential
from qmcjax.warps._numbers import normal as normal
from qmcjax.warps._numbers import simplex as simplex
from qmcjax.warps._numbers import tent as tent
from qmcjax.warps._surfaces import disc as disc
from qmcjax.warps._surfaces import hemisphere as hemisphere
from qmcjax.warps._surfaces import sphere as sphere
from qmcjax.warps._surfaces import triangle as triangle
