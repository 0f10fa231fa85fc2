"""Ray intersection as loops compiled by Numba, called by programs for CPUs.

A world consists of spaces, one for all still objects and one per moving object. A space has unbounded
primitives, which all rays test, and trees. In a tree, a ray tests the boxes of eight children at once, visits
the nearest one first and keeps the others on a stack.
"""

from typing import Any, NamedTuple

import numpy as np

from qmcjax.tracing.search import compiled_tests as tests
from qmcjax.tracing.search import compiled_triangles as triangles
from qmcjax.tracing.search.compiled_nodes import DEPTH
from qmcjax.tracing.search.lanes import WIDTH, bits, compiled, inlined, larger, load, lowest, smaller, store

STACK = DEPTH * WIDTH
"""Size of the stack: all but one of the children of each node on a path."""


class _Tree(NamedTuple):
    """A tree of a space."""

    root: Any
    mesh: Any
    moves: Any
    slack: Any
    """Of the coordinates of its boxes."""


@inlined
def _in_object_space(frames, f, i, origin, direction, time, unit, never):
    """Return a ray in a space, and its slack: ``object.seen_from``."""
    size = tests.largest(origin)
    if f >= 0:
        one, two, three, start = (
            (frames[f, i], frames[f + 1, i], frames[f + 2, i]),
            (frames[f + 3, i], frames[f + 4, i], frames[f + 5, i]),
            (frames[f + 6, i], frames[f + 7, i], frames[f + 8, i]),
            (frames[f + 9, i], frames[f + 10, i], frames[f + 11, i]),
        )
        size += tests.largest(start)
        size *= np.sqrt(tests.dot(one, one) + tests.dot(two, two) + tests.dot(three, three))
        origin = tests.minus(origin, start)
        origin = tests.dot(one, origin), tests.dot(two, origin), tests.dot(three, origin)
        direction = tests.dot(one, direction), tests.dot(two, direction), tests.dot(three, direction)
        if not abs(time) < never:
            return origin, direction, tests.dot(direction, direction), never
    squared = tests.dot(direction, direction)
    slack = unit * size if squared > 0 and squared < never else never
    return origin, direction, squared, slack


@inlined
def _near(nodes, last, row, moves, weights, beside, inverse):
    """Return where lines cross a plane of each of eight boxes."""
    plane = load(nodes, row)
    if moves:
        plane = triangles.between(plane, load(last, row), weights)
    return (plane - beside) * inverse


@inlined
def _walk(world, tree, scratch, ray, limit, any_hit):
    """Return distance and row of the first hit in a tree; the limit and -1 without a hit."""
    nodes, last, moves, weights = world.nodes, world.last, tree.moves, ray.weights
    origin, inverse, wider = ray.origin, ray.inverse, ray.slack + tree.slack
    stack, ahead, lanes = scratch
    zero = nodes.dtype.type(0)
    slower = nodes.dtype.type(1) + ray.unit
    found = -1
    # Planes that a ray meets first, and their distances from its origin, which is as wide as rounding.
    x, y, z = 0 if inverse[0] > 0 else 3, 1 if inverse[1] > 0 else 4, 2 if inverse[2] > 0 else 5
    aside = wider if x == 0 else -wider, wider if y == 1 else -wider, wider if z == 2 else -wider
    over, under = tests.plus(origin, aside), tests.minus(origin, aside)
    turned = triangles.turn_axis(origin, ray.shear[0])
    node, waiting = tree.root, 0
    while True:
        if node >= 0:
            # NaN is between planes.
            enter = larger(zero, _near(nodes, last, node + x, moves, weights, over[0], inverse[0]))
            enter = larger(enter, _near(nodes, last, node + y, moves, weights, over[1], inverse[1]))
            enter = larger(enter, _near(nodes, last, node + z, moves, weights, over[2], inverse[2]))
            leave = _near(nodes, last, node + 3 - x, moves, weights, under[0], inverse[0])
            leave = smaller(limit * slower, leave)
            leave = smaller(leave, _near(nodes, last, node + 5 - y, moves, weights, under[1], inverse[1]))
            leave = smaller(leave, _near(nodes, last, node + 7 - z, moves, weights, under[2], inverse[2]))
            # The products are rounded, too.
            hits = bits(enter <= leave * slower)
            if hits != 0:
                store(lanes, 0, enter)
                lane = lowest(hits)
                hits &= hits - 1
                row = node + 6
                node, nearest = world.links[row, lane], lanes[0, lane]
                while hits != 0:
                    lane = lowest(hits)
                    hits &= hits - 1
                    other, distance = world.links[row, lane], lanes[0, lane]
                    if distance < nearest:
                        node, nearest, other, distance = other, distance, node, nearest
                    stack[waiting], ahead[waiting] = other, distance
                    waiting += 1
                continue
        elif tree.mesh:
            row = ~node
            distances, here = triangles.eight(world.blocks, row, world.closed, moves, ray, turned, limit)
            hits = bits(here)
            if hits != 0:
                store(lanes, 0, distances)
            while hits != 0:
                lane = lowest(hits)
                hits &= hits - 1
                if lanes[0, lane] < limit and triangles.leaves(
                    world.blocks, row, lane, world.closed, moves, ray
                ):
                    limit, found = lanes[0, lane], row // triangles.BLOCK * WIDTH + lane
                    if any_hit:
                        return limit, found
        else:
            distance = _one(world, ~node, ray, limit)
            if distance > 0 and distance < limit:
                limit, found = distance, ~node
                if any_hit:
                    return limit, found
        while waiting > 0 and not ahead[waiting - 1] < limit * slower:
            waiting -= 1
        if waiting == 0:
            return limit, found
        waiting -= 1
        node = stack[waiting]


@inlined
def _one(world, k, ray, limit):
    """Return the distance of a primitive of any kind."""
    code = world.codes[k]
    if code < tests.TRIANGLE:
        return tests.distance(code, world.rows, k, ray)
    return triangles.triangle(world.rows, k, world.ends, code == tests.MOVING, ray, limit)


@inlined
def _search(world, frames, rays, i, unit, any_hit, scratch):
    """Return distance and number of the first hit of a ray; the limit and -1 without a hit."""
    ox, oy, oz, dx, dy, dz, times, limits = rays
    origin, direction, time, limit = (ox[i], oy[i], oz[i]), (dx[i], dy[i], dz[i]), times[i], limits[i]
    one, never = limits.dtype.type(1), limits.dtype.type(np.inf)
    dead = direction[0] == 0 and direction[1] == 0 and direction[2] == 0
    if dead or not limit > 0:
        return limit, -1
    if not (abs(origin[0]) < never and abs(origin[1]) < never and abs(origin[2]) < never):
        return limit, -1
    number = -1
    spaces, trees = world.spaces, world.trees
    for s in range(len(spaces)):
        o, d, squared, slack = _in_object_space(
            frames, 12 * spaces[s, 0], i, origin, direction, time, unit, never
        )
        if not slack < never:
            continue
        # Not -inf for -0: see flat.py.
        inverse = (
            one / d[0] if d[0] != 0 else never,
            one / d[1] if d[1] != 0 else never,
            one / d[2] if d[2] != 0 else never,
        )
        shear = triangles.shear(d, inverse) if spaces[s, 5] > 0 else (0, one, one, one)
        ray = tests.Ray(o, d, squared, inverse, slack, shear, (one - time, time), unit)
        for k in range(spaces[s, 1], spaces[s, 2]):
            distance = _one(world, k, ray, limit)
            if distance > 0 and distance < limit:
                limit, number = distance, world.numbers[k]
                if any_hit:
                    return limit, number
        for t in range(spaces[s, 3], spaces[s, 4]):
            tree = _Tree(trees[t, 0], trees[t, 1] != 0, trees[t, 2] != 0, world.slacks[t])
            limit, k = _walk(world, tree, scratch, ray, limit, any_hit)
            if k >= 0:
                number = world.faces[k] if tree.mesh else world.numbers[k]
                if any_hit:
                    return limit, number
    return limit, number


@compiled(_nrt=False, nogil=True)
def search(world, frames, rays, unit, any_hit, scratch, distances, numbers):
    """Search for rays: distances and primitives of their hits; the limits and -1 without a hit.

    ``unit`` is the slack of a coordinate of 1. With ``any_hit`` the first hit that is found counts.
    """
    for i in range(len(distances)):
        distances[i], numbers[i] = _search(world, frames, rays, i, unit, any_hit, scratch)
