"""Surface area trees over primitives of all kinds, built by compiled loops."""

from typing import Any, NamedTuple

import numpy as np

from qmcjax.tracing.search import compiled_tests as tests
from qmcjax.tracing.search.compiled_nodes import BinaryTree, collapse_to_wide, grow, surface
from qmcjax.tracing.search.lanes import compiled

_BINS = 8

_DEEP = 32
"""From this depth on, nodes are split in halves."""


class Primitives(NamedTuple):
    """Primitives without a tree of their own."""

    given: Any
    """For each 9 numbers, 9 for the end of the shutter, and 6 of its box."""
    kinds: Any
    numbers: Any


@compiled()
def build_primitive_tree(primitives, members, unit, first, node, world):
    """Build the tree of the primitives that are members, in rows and nodes from two given numbers on.

    Primitives with infinite boxes stay outside the tree and come after the others. Returns the number of
    primitives in the tree, the largest absolute coordinate of its boxes, and the next free node. The root is
    the first node.
    """
    given, kinds, numbers = primitives
    bounds = given[:, 18:]
    count, unbounded = 0, len(members)
    run = np.empty(len(members), np.int64)
    for m in members:
        finite = True
        for j in range(6):
            finite = finite and abs(bounds[m, j]) < np.inf
        if finite:
            run[count] = m
            count += 1
        else:
            unbounded -= 1
            run[unbounded] = m
    size = bounds.dtype.type(0)
    if count > 0:
        boxes, skip, start = _parted(run[:count], bounds)
        runs = np.empty((count, 2), np.int64)
        still = np.empty((0, 6), bounds.dtype)
        _, node = collapse_to_wide(BinaryTree(boxes, still, skip, start), 1, first, 1, node, world, runs)
        run[:count] = run[:count][runs[:, 0]]
        size = np.abs(boxes[0]).max()
    for k in range(len(run)):
        m, row = run[k], first + k
        tests.fill(world.rows, row, kinds[m], given, m, unit)
        world.codes[row], world.numbers[row] = kinds[m], numbers[m]
        if kinds[m] == tests.MOVING:
            world.ends[row, :9] = given[m, 9:18]
    return count, size, node


@compiled()
def _parted(run, bounds):
    """Sort primitives into a binary tree with one in each leaf.

    Returns boxes, next nodes and first primitives of nodes in depth-first order, as in a mesh's.
    """
    count = len(run)
    boxes = np.empty((2 * count, 6), bounds.dtype)
    skip, start = np.empty(2 * count, np.int64), np.full(2 * count, count)
    # First primitives of nodes, their counts, their numbers, and depths.
    stack = np.empty((4, 2 * count), np.int64)
    stack[0, 0], stack[1, 0], stack[2, 0], stack[3, 0] = 0, count, 0, 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        begin, many = stack[0, waiting], stack[1, waiting]
        node, depth = stack[2, waiting], stack[3, waiting]
        for j in range(3):
            boxes[node, j], boxes[node, 3 + j] = np.inf, -np.inf
        for k in range(begin, begin + many):
            grow(boxes[node], bounds[run[k]])
        # A tree of n leaves has 2 n - 1 nodes.
        skip[node], start[node] = node + 2 * many - 1, begin
        if many > 1:
            part = many // 2 if depth >= _DEEP else _sorted(run[begin : begin + many], bounds)
            for second in range(2):
                stack[0, waiting] = begin + part * second
                stack[1, waiting] = many - part if second else part
                stack[2, waiting] = node + 2 * part if second else node + 1
                stack[3, waiting] = depth + 1
                waiting += 1
    return boxes, skip, start


@compiled()
def _sorted(run, bounds):
    """Partition primitives at the plane with the smallest sum of surface times primitives."""
    best, axis, plane = np.inf, -1, 0
    least, scale = np.empty(3, np.float64), np.zeros(3, np.float64)
    boxes, many = np.empty((_BINS, 6), np.float64), np.empty(_BINS, np.int64)
    costs = np.empty(_BINS, np.float64)
    for j in range(3):
        most = -np.inf
        least[j] = np.inf
        for m in run:
            center = np.float64(bounds[m, j]) + bounds[m, 3 + j]
            least[j], most = min(least[j], center), max(most, center)
        if not most > least[j]:
            continue
        scale[j] = _BINS * (1 - 1e-9) / (most - least[j])
        boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
        many[:] = 0
        for m in run:
            place = int((np.float64(bounds[m, j]) + bounds[m, 3 + j] - least[j]) * scale[j])
            many[place] += 1
            grow(boxes[place], bounds[m])
        one = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
        count = 0
        for place in range(_BINS - 1):
            count += many[place]
            grow(one, boxes[place])
            costs[place] = count * surface(one)
        one[:3], one[3:] = np.inf, -np.inf
        count = 0
        for place in range(_BINS - 1, 0, -1):
            count += many[place]
            grow(one, boxes[place])
            cost = costs[place - 1] + count * surface(one)
            if cost < best and 0 < count < len(run):
                best, axis, plane = cost, j, place
    if axis < 0:
        return len(run) // 2
    part = 0
    for k in range(len(run)):
        m = run[k]
        center = np.float64(bounds[m, axis]) + bounds[m, 3 + axis]
        if int((center - least[axis]) * scale[axis]) < plane:
            run[k], run[part] = run[part], m
            part += 1
    return part
