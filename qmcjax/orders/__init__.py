"""Orders of the pixels of an image: maps between a pixel and its position on a curve.

Every order has ``position(x, y)``, its inverse ``pixel(position)``, ``width``, ``height`` and ``length``.
Orders of pixels and frames, :func:`morton3` and :func:`hilbert3`, have ``position(x, y, t)``.
"""

from qmcjax.orders._base import MAX_SIDE as MAX_SIDE
from qmcjax.orders._base import FrameOrder as FrameOrder
from qmcjax.orders._base import OneFrame as OneFrame
from qmcjax.orders._base import Order as Order
from qmcjax.orders._base import log_side as log_side
from qmcjax.orders._hierarchy import STEP as STEP
from qmcjax.orders._hierarchy import ScrambledMorton as ScrambledMorton
from qmcjax.orders._hilbert import PEANO_SIDE as PEANO_SIDE
from qmcjax.orders._hilbert import hilbert as hilbert
from qmcjax.orders._hilbert import hilbert3 as hilbert3
from qmcjax.orders._hilbert import moore as moore
from qmcjax.orders._hilbert import peano as peano
from qmcjax.orders._morton import accordion as accordion
from qmcjax.orders._morton import morton as morton
from qmcjax.orders._morton import raster as raster
from qmcjax.orders._optimized import OptimizedOrder as OptimizedOrder
from qmcjax.orders._optimized import optimized as optimized
from qmcjax.orders._plug_in import OrderLike as OrderLike
from qmcjax.orders._plug_in import as_order as as_order
from qmcjax.orders._plug_in import permutation as permutation
from qmcjax.orders._scrambled_morton import VARIANTS as VARIANTS
from qmcjax.orders._scrambled_morton import morton3 as morton3
from qmcjax.orders._scrambled_morton import scrambled_morton as scrambled_morton
