"""What ray-traced scenes are made of: so far, motion."""

from qmcjax.tracing import motion as motion
