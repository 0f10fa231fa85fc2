"""Trees as compiled loops walk them: each node holds the boxes of both its children.

A node is a row of 16 numbers: low and high of the first child, low and high of the second; then the two
children as integers, in the same memory. A leaf is a negative child, ``~(first row * 8 + primitives)``.
"""

import numpy as np

from qmcjax.tracing import _compiled_tests as tests
from qmcjax.tracing._numba import compiled

NOTHING = -1
"""A leaf without primitives."""

_BINS = 8

_LEAF = 2
"""Primitives of many kinds in a leaf, at most: their tests cost more than boxes."""

_DEEP = 32
"""From this depth on, nodes are halved."""


@compiled()
def _leaf(first, count):
    return ~(first * 8 + count)


@compiled()
def plant(given, kinds, members, unit, first, node, rows, ends, codes, order, nodes, links):
    """Make the tree of the primitives that are members, in rows and nodes from two numbers on.

    ``given`` has for each primitive 9 numbers, 9 for the end of the shutter, and 6 of its box.
    Boxes that are not finite have no place in a tree: their primitives come after the others. Returns how
    many are in the tree, and the largest absolute coordinate of its boxes. The root is the first node, and
    has one child.
    """
    bounds = given[:, 18:]
    count, loose = 0, len(members)
    for m in members:
        finite = True
        for j in range(6):
            finite = finite and abs(bounds[m, j]) < np.inf
        if finite:
            order[first + count] = m
            count += 1
        else:
            loose -= 1
            order[first + loose] = m
    nodes[node] = 0
    links[node, 12], links[node, 13] = NOTHING, NOTHING
    free = node + 1
    stack = np.empty((2 * len(members) + 2, 5), np.int64)  # first, count, parent, which child, depth
    waiting = 0
    if count > 0:
        stack[0] = 0, count, node, 0, 0
        waiting = 1
    low, high = np.empty(3, bounds.dtype), np.empty(3, bounds.dtype)
    while waiting > 0:
        waiting -= 1
        begin, many, parent, child, depth = stack[waiting]
        run = order[first + begin : first + begin + many]
        low[:], high[:] = np.inf, -np.inf
        for m in run:
            for j in range(3):
                low[j], high[j] = min(low[j], bounds[m, j]), max(high[j], bounds[m, 3 + j])
        for j in range(3):
            nodes[parent, 6 * child + j], nodes[parent, 6 * child + 3 + j] = low[j], high[j]
        if many <= _LEAF:
            links[parent, 12 + child] = _leaf(first + begin, many)
            continue
        links[parent, 12 + child] = free
        links[free, 14], links[free, 15] = 0, 0
        part = many // 2 if depth >= _DEEP else _parted(run, bounds)
        stack[waiting] = begin, part, free, 0, depth + 1
        stack[waiting + 1] = begin + part, many - part, free, 1, depth + 1
        waiting += 2
        free += 1
    for k in range(first, first + len(members)):
        tests.fill(rows, k, kinds[order[k]], given, order[k], unit)
        codes[k] = kinds[order[k]]
        if codes[k] == tests.MOVING:
            ends[k, :9] = given[order[k], 9:18]
    size = bounds.dtype.type(0)
    for j in range(6):
        size = max(size, abs(nodes[node, j]))
    return count, size


@compiled()
def _parted(run, bounds):
    """Sort primitives to both sides of the plane that makes surfaces times primitives least."""
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
            for k in range(3):
                boxes[place, k] = min(boxes[place, k], bounds[m, k])
                boxes[place, 3 + k] = max(boxes[place, 3 + k], bounds[m, 3 + k])
        one = np.array([np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf])
        count = 0
        for place in range(_BINS - 1):
            count += many[place]
            costs[place] = count * _grown(one, boxes[place])
        one[:3], one[3:] = np.inf, -np.inf
        count = 0
        for place in range(_BINS - 1, 0, -1):
            count += many[place]
            cost = costs[place - 1] + count * _grown(one, boxes[place])
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


@compiled()
def _grown(box, other):
    """Let a box grow around another one, and return half its surface, 0 of none."""
    for k in range(3):
        box[k], box[3 + k] = min(box[k], other[k]), max(box[3 + k], other[3 + k])
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x if x >= 0 else 0.0


@compiled()
def graft(vertices, close, order, skip, start, unit, first, node, rows, ends, nodes, links, last):
    """Take over the tree of a mesh, :class:`qmcjax.tracing._tree.Tree`, with the boxes of its vertices.

    Where vertices move, ``last`` gets the boxes at the end of the shutter. Returns the largest absolute
    coordinate.
    """
    count, used = len(order), skip[0]
    moves = len(close) > 0
    for k in range(count):
        tests.fill(rows, first + k, tests.TRIANGLE, vertices, order[k], unit)
        if moves:
            ends[first + k, :9] = close[order[k]]
    inner = np.empty(used, links.dtype)
    free = node
    for n in range(used):
        if skip[n] > n + 1 or n == 0:
            inner[n] = free
            free += 1
        else:
            inner[n] = _leaf(first + start[n], start[n + 1] - start[n])
    size = vertices.dtype.type(0)
    for end in range(2 if moves else 1):
        size = max(
            size,
            _refitted(
                inner, skip, start, rows if end == 0 else ends, first, nodes if end == 0 else last, links
            ),
        )
    if used == 1:
        links[node, 12], links[node, 13] = _leaf(first, count), NOTHING
    return size


@compiled()
def _refitted(inner, skip, start, rows, first, nodes, links):
    """Fill in the boxes of all nodes from the bottom up, and the children."""
    used = len(inner)
    boxes = np.empty((used, 6), rows.dtype)
    for n in range(used - 1, -1, -1):
        if skip[n] == n + 1:
            for j in range(3):
                low = high = rows[first + start[n], j]
                for k in range(first + start[n], first + start[n + 1]):
                    for i in range(j, 9, 3):
                        low, high = min(low, rows[k, i]), max(high, rows[k, i])
                boxes[n, j], boxes[n, 3 + j] = low, high
        else:
            other, here = skip[n + 1], inner[n]
            for j in range(3):
                boxes[n, j] = min(boxes[n + 1, j], boxes[other, j])
                boxes[n, 3 + j] = max(boxes[n + 1, 3 + j], boxes[other, 3 + j])
            nodes[here, :6], nodes[here, 6:12] = boxes[n + 1], boxes[other]
            links[here, 12], links[here, 13] = inner[n + 1], inner[other]
    if used == 1:
        nodes[inner[0], :6], nodes[inner[0], 6:12] = boxes[0], boxes[0]
    return np.abs(boxes[0]).max()
