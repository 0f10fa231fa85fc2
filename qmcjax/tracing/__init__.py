"""What ray-traced scenes are made of: motion, shapes, cameras, lights, materials and estimators."""

from qmcjax.tracing import motion as motion
