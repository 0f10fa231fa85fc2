"""Samplers of qmcjax as a sampler plugin of Mitsuba 3 (``pip install 'qmcjax[mitsuba]'``).

:func:`register` registers the plugin, :func:`wrap` wraps a sampler for Mitsuba's dictionaries. :func:`render`
and :func:`sensor_with` put a sampler into a scene of a file, :func:`render_adaptive` takes samples where they
are needed.
"""

from qmcjax.bridges.mitsuba._adaptive import render_adaptive as render_adaptive
from qmcjax.bridges.mitsuba._register import check_llvm as check_llvm
from qmcjax.bridges.mitsuba._register import register as register
from qmcjax.bridges.mitsuba._register import wrap as wrap
from qmcjax.bridges.mitsuba._sensors import render as render
from qmcjax.bridges.mitsuba._sensors import sensor_with as sensor_with
