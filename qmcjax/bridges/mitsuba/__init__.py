"""Samplers of qmcjax as a sampler plugin of Mitsuba 3 (``pip install 'qmcjax[mitsuba]'``).

:func:`register` registers the plugin, and :func:`wrap` wraps a sampler for Mitsuba's dictionaries.
:func:`render` and :func:`sensor_with` use a sampler in a scene from a file.
"""

from qmcjax.bridges.mitsuba._register import check_llvm as check_llvm
from qmcjax.bridges.mitsuba._register import register as register
from qmcjax.bridges.mitsuba._register import wrap as wrap
from qmcjax.bridges.mitsuba._sensors import render as render
from qmcjax.bridges.mitsuba._sensors import sensor_with as sensor_with
