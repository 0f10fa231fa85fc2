from analysis import *  # noqa: F403
from analysis import trees as trees
