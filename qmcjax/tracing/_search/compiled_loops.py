"""Ray intersection as loops compiled by Numba, called by programs for CPUs.

A world consists of spaces, one for all still objects and one per moving object; a space has unbounded
primitives, which all rays test, and trees. In a tree, a ray tests the boxes of eight children at once, goes
to the nearest one first and keeps the others on a stack.
"""

import numpy as np

from qmcjax.tracing._search import compiled_tests as tests
from qmcjax.tracing._search import compiled_triangles as triangles
from qmcjax.tracing._search.compiled_nodes import DEPTH
from qmcjax.tracing._search.lanes import WIDTH, bits, larger, load, lowest, smaller, store
from qmcjax.tracing._search.numba_decorators import compiled, inlined

STACK = DEPTH * WIDTH
"""Size of the stack: all but one of the children of each node on a path."""


@inlined
def _seen(frames, f, i, origin, direction, time, unit, never):
    """Return a ray in a space, and its slack: ``_object.seen_from``."""
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
def _walk(
    world,
    root,
    mesh,
    moves,
    scratch,
    origin,
    direction,
    weights,
    squared,
    inverse,
    shear,
    slack,
    wider,
    unit,
    limit,
    any_hit,
):
    """Return distance and row of the first hit in a tree; the limit and -1 without a hit."""
    rows, ends, codes, blocks, closed, nodes, last, links = world
    stack, ahead, lanes = scratch
    zero = rows.dtype.type(0)
    slower = rows.dtype.type(1) + unit
    found = -1
    # Planes that a ray meets first, and their distances from its origin, which is as wide as rounding.
    x, y, z = 0 if inverse[0] > 0 else 3, 1 if inverse[1] > 0 else 4, 2 if inverse[2] > 0 else 5
    over, under = (
        (
            origin[0] + wider if x == 0 else origin[0] - wider,
            origin[1] + wider if y == 1 else origin[1] - wider,
            origin[2] + wider if z == 2 else origin[2] - wider,
        ),
        (
            origin[0] - wider if x == 0 else origin[0] + wider,
            origin[1] - wider if y == 1 else origin[1] + wider,
            origin[2] - wider if z == 2 else origin[2] + wider,
        ),
    )
    turned = triangles.turned(origin, shear[0])
    node, waiting = root, 0
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
                node, nearest = links[row, lane], lanes[0, lane]
                while hits != 0:
                    lane = lowest(hits)
                    hits &= hits - 1
                    other, distance = links[row, lane], lanes[0, lane]
                    if distance < nearest:
                        node, nearest, other, distance = other, distance, node, nearest
                    stack[waiting], ahead[waiting] = other, distance
                    waiting += 1
                continue
        elif mesh:
            row = ~node
            distances, here = triangles.eight(blocks, row, closed, moves, weights, turned, shear, limit)
            hits = bits(here)
            if hits != 0:
                store(lanes, 0, distances)
            while hits != 0:
                lane = lowest(hits)
                hits &= hits - 1
                if lanes[0, lane] < limit and triangles.leaves(
                    blocks, row, lane, closed, moves, weights, origin, slack, unit
                ):
                    limit, found = lanes[0, lane], row // triangles.BLOCK * WIDTH + lane
                    if any_hit:
                        return limit, found
        else:
            distance = _one(
                rows,
                ends,
                codes,
                ~node,
                origin,
                direction,
                weights,
                squared,
                inverse,
                shear,
                slack,
                unit,
                limit,
            )
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
def _one(rows, ends, codes, k, origin, direction, weights, squared, inverse, shear, slack, unit, limit):
    """Return the distance of a primitive of any kind."""
    code = codes[k]
    if code < tests.TRIANGLE:
        return tests.distance(code, rows, k, origin, direction, squared, inverse, slack)
    moves = code == tests.MOVING
    return triangles.triangle(rows, k, ends, moves, weights, origin, shear, slack, unit, limit)


@inlined
def _search(
    world, names, spaces, trees, sizes, frames, i, scratch, origin, direction, time, limit, unit, any_hit
):
    """Return distance and number of the first hit of a ray; the limit and -1 without a hit."""
    rows, ends, codes = world[:3]
    one, never = rows.dtype.type(1), rows.dtype.type(np.inf)
    weights = one - time, time
    found = -1
    for s in range(len(spaces)):
        frame, loose, stop = spaces[s, 0], spaces[s, 1], spaces[s, 2]
        o, d, squared, slack = _seen(frames, 12 * frame, i, origin, direction, time, unit, never)
        if not slack < never:
            continue
        # Not -inf for -0: see _flat.py.
        inverse = (
            one / d[0] if d[0] != 0 else never,
            one / d[1] if d[1] != 0 else never,
            one / d[2] if d[2] != 0 else never,
        )
        shear = triangles.shear(d, inverse) if spaces[s, 5] > 0 else (0, one, one, one)
        for k in range(loose, stop):
            distance = _one(rows, ends, codes, k, o, d, weights, squared, inverse, shear, slack, unit, limit)
            if distance > 0 and distance < limit:
                limit, found = distance, names[0][k]
                if any_hit:
                    return limit, found
        for t in range(spaces[s, 3], spaces[s, 4]):
            mesh, moves = trees[t, 1] != 0, trees[t, 2] != 0
            limit, k = _walk(
                world,
                trees[t, 0],
                mesh,
                moves,
                scratch,
                o,
                d,
                weights,
                squared,
                inverse,
                shear,
                slack,
                slack + sizes[t],
                unit,
                limit,
                any_hit,
            )
            if k >= 0:
                found = names[1][k] if mesh else names[0][k]
                if any_hit:
                    return limit, found
    return limit, found


@compiled(_nrt=False, nogil=True)
def search(world, names, spaces, trees, sizes, frames, rays, unit, any_hit, scratch, distances, numbers):
    """Search for rays: distances and primitives of their hits; the limits and -1 without a hit.

    ``unit`` is the slack of a coordinate of 1. With ``any_hit`` the first hit that is found counts.
    """
    ox, oy, oz, dx, dy, dz, time, limit = rays
    never = limit.dtype.type(np.inf)
    for i in range(len(limit)):
        distances[i], numbers[i] = limit[i], -1
        o, d = (ox[i], oy[i], oz[i]), (dx[i], dy[i], dz[i])
        dead = d[0] == 0 and d[1] == 0 and d[2] == 0
        if dead or not limit[i] > 0:
            continue
        if not (abs(o[0]) < never and abs(o[1]) < never and abs(o[2]) < never):
            continue
        distances[i], numbers[i] = _search(
            world, names, spaces, trees, sizes, frames, i, scratch, o, d, time[i], limit[i], unit, any_hit
        )
