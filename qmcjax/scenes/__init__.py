"""Scenes: functions on the unit cube with names for their dimensions, and exact images of them."""

from qmcjax.scenes._base import Scene as Scene
from qmcjax.scenes._checkerboard import Checkerboard as Checkerboard
from qmcjax.scenes._checkerboard import checkerboard as checkerboard
from qmcjax.scenes._zone_plate import ZonePlate as ZonePlate
from qmcjax.scenes._zone_plate import zone_plate as zone_plate
