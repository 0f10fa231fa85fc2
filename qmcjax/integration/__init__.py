"""Integration: the mean of a function over a sequence, and its confidence interval."""

from qmcjax.integration._estimate import Estimate as Estimate
from qmcjax.integration._integrate import integrate as integrate
from qmcjax.integration._integrate import randomise as randomise
