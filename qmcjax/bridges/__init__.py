"""Interfaces to other programs: plain Python, source code, textures, files.

``import qmcjax`` does not import them. Arguments are checked: a TypeError or ValueError names the argument,
the requirement and the value.
"""

from qmcjax.bridges._bake import BakedTable as BakedTable
from qmcjax.bridges._bake import bake as bake
from qmcjax.bridges._engines import SequenceEngine as SequenceEngine
from qmcjax.bridges._engines import tabulate as tabulate
from qmcjax.bridges._images import read_image as read_image
from qmcjax.bridges._images import read_mask as read_mask
from qmcjax.bridges._images import write_image as write_image
from qmcjax.bridges._plain import PlainSampler as PlainSampler
from qmcjax.bridges._points import read_points as read_points
from qmcjax.bridges._points import write_points as write_points
from qmcjax.bridges._source import seeds as seeds
from qmcjax.bridges._source import source as source
