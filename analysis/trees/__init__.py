"""Binary trees of boxes for ray tracing: construction, cost, and motion (thesis, Chapter 4).

These trees are for studies, in NumPy and float64. :func:`qmcjax.tracing.nearest_hit` uses other trees.
"""

from analysis.trees._clusters import quadratic_split_tree as quadratic_split_tree
from analysis.trees._clusters import two_means_tree as two_means_tree
from analysis.trees._motion import boxes_during as boxes_during
from analysis.trees._motion import split_in_time as split_in_time
from analysis.trees._optimal import optimal_subtrees as optimal_subtrees
from analysis.trees._structure import Tree as Tree
from analysis.trees._structure import node_depths as node_depths
from analysis.trees._structure import refitted as refitted
from analysis.trees._structure import summed_area as summed_area
from analysis.trees._structure import surface_area as surface_area
from analysis.trees._sweep import hilbert_tree as hilbert_tree
from analysis.trees._sweep import morton_tree as morton_tree
from analysis.trees._sweep import surface_area_tree as surface_area_tree
from analysis.trees._visited import nodes_visited as nodes_visited
from analysis.trees._visited import triangle_distances as triangle_distances
