"""Binary trees of boxes for ray tracing, to study: how they are built, what they cost, and over motion.

They are made in NumPy, in float64 (thesis, Chapter 4). What :func:`qmcjax.tracing.nearest_hit` searches with
are trees of its own.
"""

from qmcjax.tracing.trees._boxes import surface_area as surface_area
from qmcjax.tracing.trees._curves import hilbert_tree as hilbert_tree
from qmcjax.tracing.trees._curves import morton_tree as morton_tree
from qmcjax.tracing.trees._motion import boxes_during as boxes_during
from qmcjax.tracing.trees._motion import split_in_time as split_in_time
from qmcjax.tracing.trees._optimal import optimal_subtrees as optimal_subtrees
from qmcjax.tracing.trees._quadratic import quadratic_split_tree as quadratic_split_tree
from qmcjax.tracing.trees._structure import Tree as Tree
from qmcjax.tracing.trees._structure import node_depths as node_depths
from qmcjax.tracing.trees._structure import refitted as refitted
from qmcjax.tracing.trees._structure import summed_area as summed_area
from qmcjax.tracing.trees._sweep import surface_area_tree as surface_area_tree
from qmcjax.tracing.trees._two_means import two_means_tree as two_means_tree
from qmcjax.tracing.trees._visited import nodes_visited as nodes_visited
from qmcjax.tracing.trees._visited import triangle_distances as triangle_distances
