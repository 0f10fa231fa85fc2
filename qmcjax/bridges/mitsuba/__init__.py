"""Samplers of qmcjax as a sampler plugin of Mitsuba 3 (``pip install 'qmcjax[mitsuba]'``).

:func:`register` registers the plugin, :func:`held` wraps a sampler for Mitsuba's dictionaries.
"""

from qmcjax.bridges.mitsuba._llvm import check_llvm as check_llvm
from qmcjax.bridges.mitsuba._register import held as held
from qmcjax.bridges.mitsuba._register import register as register
