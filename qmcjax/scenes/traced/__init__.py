"""Ray-traced scenes of the papers' images, made with :mod:`qmcjax.tracing`."""

from qmcjax.scenes.traced._base import Traced as Traced
from qmcjax.scenes.traced._cornell_box import cornell_box as cornell_box
from qmcjax.scenes.traced._effects import caustic as caustic
from qmcjax.scenes.traced._effects import defocus as defocus
from qmcjax.scenes.traced._effects import moving_triangles as moving_triangles
from qmcjax.scenes.traced._effects import occluder as occluder
from qmcjax.scenes.traced._helicopter import helicopter as helicopter
from qmcjax.scenes.traced._interior import interior as interior
from qmcjax.scenes.traced._sports import sports as sports
from qmcjax.scenes.traced._stored import Content as Content
from qmcjax.scenes.traced._stored import content as content
from qmcjax.scenes.traced._stored import load as load
from qmcjax.scenes.traced._stored import read as read
from qmcjax.scenes.traced._stored import save as save

NAMES = ("cornell_box", "helicopter", "occluder", "defocus", "sports", "interior", "caustic")
"""Functions that make scenes with stored references."""
