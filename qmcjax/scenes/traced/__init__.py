"""Ray-traced scenes of the papers' images, made with :mod:`qmcjax.tracing`."""

from qmcjax.scenes.traced._base import Content as Content
from qmcjax.scenes.traced._base import Traced as Traced
from qmcjax.scenes.traced._base import content as content
from qmcjax.scenes.traced._base import load as load
from qmcjax.scenes.traced._base import read as read
from qmcjax.scenes.traced._base import save as save
from qmcjax.scenes.traced._effects import caustic as caustic
from qmcjax.scenes.traced._effects import defocus as defocus
from qmcjax.scenes.traced._effects import moving_triangles as moving_triangles
from qmcjax.scenes.traced._effects import occluder as occluder
from qmcjax.scenes.traced._helicopter import helicopter as helicopter
from qmcjax.scenes.traced._rooms import cornell_box as cornell_box
from qmcjax.scenes.traced._rooms import interior as interior
from qmcjax.scenes.traced._vehicles import sports as sports

NAMES = ("cornell_box", "helicopter", "occluder", "defocus", "sports", "interior", "caustic")
"""Functions that make scenes with stored references."""
