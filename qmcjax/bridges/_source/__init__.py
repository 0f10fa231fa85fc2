"""Samplers, sequences and scenes as source code of other languages."""

from qmcjax.bridges._source._program import Compute as Compute
from qmcjax.bridges._source._program import Loop as Loop
from qmcjax.bridges._source._program import Program as Program
from qmcjax.bridges._source._program import Repeat as Repeat
from qmcjax.bridges._source._program import Table as Table
from qmcjax.bridges._source._program import Value as Value
from qmcjax.bridges._source._read import read as read
from qmcjax.bridges._source._seeds import seeds as seeds
from qmcjax.bridges._source._source import source as source
