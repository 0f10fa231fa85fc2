"""Samplers of ours as a sampler plug-in of Mitsuba 3, which ``pip install 'qmcjax[mitsuba]'`` installs.

:func:`register` makes the plug-in, :func:`held` puts a sampler into the dictionaries that Mitsuba loads.
"""

from qmcjax.bridges.mitsuba._llvm import check_llvm as check_llvm
from qmcjax.bridges.mitsuba._register import held as held
from qmcjax.bridges.mitsuba._register import register as register
