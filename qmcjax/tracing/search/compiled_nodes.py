"""Trees for compiled loops: each node contains the boxes of up to eight children.

A node is 7 rows of 8 numbers, one for each child: x, y and z of the low corners, of the high corners, and
integers in the same memory. An integer is the first row of a node, or ``~k`` for a leaf: k is the first row
of a block of triangles for a mesh, else the row of one primitive.
"""

from typing import Any, NamedTuple

import numpy as np

from qmcjax.tracing._shapes.triangles import half_area
from qmcjax.tracing.search import compiled_tests as tests
from qmcjax.tracing.search.compiled_triangles import BLOCK
from qmcjax.tracing.search.lanes import WIDTH, compiled

NODE = 7
"""Rows of a node."""

DEPTH = 64
"""Maximum number of nodes on a path."""


class World(NamedTuple):
    """Arrays that rays are tested against."""

    rows: Any
    """Primitives without a mesh's tree: see ``compiled_tests.fill``."""
    ends: Any
    """Vertices of moving triangles among them, at the end of the shutter."""
    codes: Any
    numbers: Any
    """Their numbers in the world."""
    blocks: Any
    """Triangles of meshes, and at the end of the shutter."""
    closed: Any
    faces: Any
    """Their numbers in the world."""
    nodes: Any
    last: Any
    """Nodes at the end of the shutter."""
    links: Any
    """Integers of nodes."""
    spaces: Any
    """For each space its frame, the range of primitives outside of trees, the range of trees, and whether it
    has triangles."""
    trees: Any
    """For each tree its root, and whether it is a mesh and moves."""
    slacks: Any
    """For each tree the slack of its boxes."""


class Primitives(NamedTuple):
    """Primitives without a tree of their own."""

    given: Any
    """For each primitive 9 numbers, 9 for the end of the shutter, and 6 of its box."""
    kinds: Any
    numbers: Any


class BinaryTree(NamedTuple):
    """Boxes, at both ends of the shutter (or empty), and structure: ``triangle_tree.Tree``."""

    boxes: Any
    close: Any
    skip: Any
    start: Any


class Mesh(NamedTuple):
    """Vertices (n, 9), at both ends of the shutter (or empty), and their ``triangle_tree.Tree``."""

    vertices: Any
    close: Any
    order: Any
    skip: Any
    start: Any


@compiled()
def grow(box, other):
    """Grow a box to include another one."""
    for j in range(3):
        box[j], box[3 + j] = min(box[j], other[j]), max(box[3 + j], other[3 + j])


_half_area = compiled()(half_area)


@compiled()
def surface(box):
    """Return half the surface of a box; 0 for an empty one."""
    x = box[3] - box[0]
    return _half_area(x, box[4] - box[1], box[5] - box[2]) if x >= 0 else x - x


@compiled()
def collapse_to_wide(tree, most, base, step, node, world, runs):
    """Collapse a binary tree to nodes of eight children and leaves of up to ``most`` primitives.

    Nodes are filled from a given one on, leaves have numbers
    from ``base`` on in steps, and ``runs`` gets the start and stop of their primitives. Returns the number of
    leaves and the next free node.
    """
    boxes, close, skip, start = tree
    nodes, last, links = world.nodes, world.last, world.links
    nothing = np.finfo(boxes.dtype).max / 2
    moves = len(close) > 0
    splits = _cheapest(tree, most)
    stack, children = np.empty((DEPTH * WIDTH, 2), np.int64), np.zeros(WIDTH, np.int64)
    stack[0, 0], stack[0, 1] = 0, node
    waiting, free, leaves = 1, node + 1, 0
    while waiting > 0:
        waiting -= 1
        count = _children(stack[waiting, 0], splits, skip, children)
        row = NODE * stack[waiting, 1]
        for c in range(WIDTH):
            n = children[c]
            for j in range(6):
                # Without a child: a box that no ray hits.
                none = nothing if j < 3 else -nothing
                nodes[row + j, c] = boxes[n, j] if c < count else none
                if moves:
                    last[row + j, c] = close[n, j] if c < count else none
            if c >= count:
                links[row + 6, c] = ~base
                continue
            if start[skip[n]] - start[n] <= most:
                links[row + 6, c] = ~(base + step * leaves)
                runs[leaves, 0], runs[leaves, 1] = start[n], start[skip[n]]
                leaves += 1
            else:
                links[row + 6, c] = NODE * free
                stack[waiting, 0], stack[waiting, 1] = n, free
                waiting += 1
                free += 1
    return leaves, free


@compiled()
def _cheapest(tree, most):
    """Return the number of wide trees, from 1 to 8, that makes the left child of a node cheapest [1]_.

    For each node and maximum number of trees for both sides, less 1; 0 where one tree less costs the same.
    The first entry is for a node with eight children; a leaf has 0 everywhere.

    References
    ----------
    .. [1] H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
       BVHs", 2017.
    """
    boxes, close, skip, start = tree
    used = skip[0]
    costs, splits = np.empty((used, WIDTH), boxes.dtype), np.zeros((used, WIDTH), np.int8)
    for n in range(used - 1, -1, -1):
        area = surface(boxes[n])
        if len(close) > 0:
            area += surface(close[n])
        costs[n] = area
        if start[skip[n]] - start[n] <= most:
            continue
        one, other = costs[n + 1], costs[skip[n + 1]]
        for i in range(1, WIDTH):
            costs[n, i], splits[n, i] = one[0] + other[i - 1], 1
            for k in range(1, i):
                cost = one[k] + other[i - 1 - k]
                if cost < costs[n, i]:
                    costs[n, i], splits[n, i] = cost, k + 1
        splits[n, 0] = splits[n, WIDTH - 1]
        costs[n, 0] += costs[n, WIDTH - 1]
        for i in range(1, WIDTH):
            if costs[n, i] >= costs[n, i - 1]:
                costs[n, i], splits[n, i] = costs[n, i - 1], 0
    return splits


@compiled()
def _children(node, splits, skip, children):
    """Find the children of a node that is not a leaf, and return their number."""
    stack = np.empty(
        (WIDTH, 2), np.int64
    )  # Nodes of the binary tree, and their maximum number of trees, less 1.
    count, waiting = 0, 1
    stack[0, 0], stack[0, 1] = node, WIDTH - 1
    while waiting > 0:
        waiting -= 1
        n, most = stack[waiting, 0], stack[waiting, 1]
        split = splits[n, 0]
        if n != node:
            while most > 0 and splits[n, most] == 0:
                most -= 1
            split = splits[n, most] if most > 0 else 0
        if split == 0:
            children[count] = n
            count += 1
            continue
        stack[waiting, 0], stack[waiting, 1] = n + 1, split - 1
        stack[waiting + 1, 0], stack[waiting + 1, 1] = skip[n + 1], most - split
        waiting += 2
    return count


@compiled()
def build_mesh_tree(mesh, world, first, node):
    """Insert a mesh with the boxes of its vertices: blocks and nodes are filled from given numbers on.

    Returns the largest absolute coordinate, and the next free block and node.
    """
    vertices, close, order, skip, start = mesh
    moves = len(close) > 0
    boxes = _boxes(vertices, order, skip, start)
    far = _boxes(close, order, skip, start) if moves else boxes[:0]
    runs = np.empty((len(order), 2), np.int64)
    tree = BinaryTree(boxes, far, skip, start)
    leaves, free = collapse_to_wide(tree, WIDTH, BLOCK * first, BLOCK, node, world, runs)
    for b in range(leaves):
        for c in range(WIDTH):
            # An incomplete block repeats its last triangle.
            k = order[min(runs[b, 0] + c, runs[b, 1] - 1)]
            world.faces[WIDTH * (first + b) + c] = k
            for j in range(BLOCK):
                world.blocks[BLOCK * (first + b) + j, c] = vertices[k, j]
                if moves:
                    world.closed[BLOCK * (first + b) + j, c] = close[k, j]
    size = np.abs(boxes[0]).max()
    if moves:
        size = max(size, np.abs(far[0]).max())
    return size, first + leaves, free


@compiled()
def _boxes(vertices, order, skip, start):
    """Return the boxes of all nodes of the tree of a mesh."""
    boxes = np.empty((skip[0], 6), vertices.dtype)
    for n in range(skip[0] - 1, -1, -1):
        box = boxes[n]
        if skip[n] > n + 1:
            for j in range(6):
                box[j] = boxes[n + 1, j]
            grow(box, boxes[skip[n + 1]])
            continue
        for j in range(3):
            low = high = vertices[order[start[n]], j]
            for at in range(start[n], start[skip[n]]):
                for i in range(j, 9, 3):
                    value = vertices[order[at], i]
                    low, high = min(low, value), max(high, value)
            box[j], box[3 + j] = low, high
    return boxes


@compiled()
def insert_primitives(primitives, run, tree, unit, first, node, world):
    """Insert primitives in rows from a given one on, and a tree over the first of them in nodes.

    ``run`` has those with finite boxes in the order of the tree, then the others. Returns the largest
    absolute coordinate of the boxes, and the next free node. The root is the first node.
    """
    given, kinds, numbers = primitives
    skip, start = tree
    count = start[skip[0]]
    size = given.dtype.type(0)
    if count > 0:
        bounds = given[:, 18:][run[:count]]
        corners = np.concatenate((bounds, bounds[:, :3]), axis=1)
        boxes = _boxes(corners, np.arange(count), skip, start)
        runs, still = np.empty((count, 2), np.int64), np.empty((0, 6), given.dtype)
        _, node = collapse_to_wide(BinaryTree(boxes, still, skip, start), 1, first, 1, node, world, runs)
        run[:count] = run[:count][runs[:, 0]]
        size = np.abs(boxes[0]).max()
    for k in range(len(run)):
        m, row = run[k], first + k
        tests.fill(world.rows, row, kinds[m], given, m, unit)
        world.codes[row], world.numbers[row] = kinds[m], numbers[m]
        if kinds[m] == tests.MOVING:
            world.ends[row, :9] = given[m, 9:18]
    return size, node
