"""The search of rays in a world as loops that Numba compiles: what programs for CPUs call.

A world is made of spaces, that of all which is still and those of objects that move; a space has primitives
beyond any box, which all rays test, and trees. In a tree, a ray goes to the nearer child first and keeps the
other on a stack.
"""

import numpy as np

from qmcjax.tracing import _compiled_tests as tests
from qmcjax.tracing._numba import compiled, inlined

STACK = 128
"""More than the depth of any tree."""


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
def _slab(nodes, last, moves, node, near, far, below, above, inverse, time, enter, leave):
    """Narrow where a ray is in a box to where it is between two planes; NaN is between them."""
    one, other = nodes[node, near], nodes[node, far]
    if moves:
        first = nodes.dtype.type(1) - time
        one, other = first * one + time * last[node, near], first * other + time * last[node, far]
    one, other = (one - above) * inverse, (other - below) * inverse
    return one if one > enter else enter, other if other < leave else leave


@inlined
def _walk(
    rows,
    ends,
    codes,
    nodes,
    last,
    links,
    root,
    mesh,
    moves,
    stack,
    ahead,
    origin,
    direction,
    time,
    squared,
    inverse,
    shear,
    slack,
    wider,
    unit,
    limit,
    any_hit,
):
    """Return distance and row of the first hit in a tree, the limit and -1 without one."""
    zero = rows.dtype.type(0)
    slower = rows.dtype.type(1) + unit
    found = -1
    # Planes that a ray meets first, and how far they are from its origin, which is as wide as rounding.
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
    xx, yy, zz = 3 - x, 5 - y, 7 - z
    stack[0], ahead[0] = root, zero
    waiting = 1
    while waiting > 0:
        waiting -= 1
        if not ahead[waiting] < limit * slower:
            continue
        node = stack[waiting]
        while node >= 0:
            reach = limit * slower
            enter, leave = _slab(
                nodes, last, moves, node, x, xx, under[0], over[0], inverse[0], time, zero, reach
            )
            enter, leave = _slab(
                nodes, last, moves, node, y, yy, under[1], over[1], inverse[1], time, enter, leave
            )
            enter, leave = _slab(
                nodes, last, moves, node, z, zz, under[2], over[2], inverse[2], time, enter, leave
            )
            other, leaves = _slab(
                nodes, last, moves, node, x + 6, xx + 6, under[0], over[0], inverse[0], time, zero, reach
            )
            other, leaves = _slab(
                nodes, last, moves, node, y + 6, yy + 6, under[1], over[1], inverse[1], time, other, leaves
            )
            other, leaves = _slab(
                nodes, last, moves, node, z + 6, zz + 6, under[2], over[2], inverse[2], time, other, leaves
            )
            # The products are rounded, too.
            first, second = enter <= leave * slower, other <= leaves * slower
            near, far = links[node, 12], links[node, 13]
            if first and second:
                if other < enter:
                    near, far, other = far, near, enter
                stack[waiting], ahead[waiting] = far, other
                waiting += 1
                node = near
            elif first:
                node = near
            elif second:
                node = far
            else:
                break
        if node >= 0:
            continue
        begin, count = ~node >> 3, ~node & 7
        for k in range(begin, begin + count):
            if mesh:
                distance = tests.triangle(rows, k, ends, moves, time, origin, shear, slack, unit, limit)
            else:
                distance = _one(
                    rows, ends, codes, k, origin, direction, time, squared, inverse, shear, slack, unit, limit
                )
            if distance > 0 and distance < limit:
                limit, found = distance, k
                if any_hit:
                    return limit, found
    return limit, found


@inlined
def _one(rows, ends, codes, k, origin, direction, time, squared, inverse, shear, slack, unit, limit):
    """Return the distance of a primitive of any kind."""
    code = codes[k]
    if code < tests.TRIANGLE:
        return tests.distance(code, rows, k, origin, direction, squared, inverse, slack)
    moves = code == tests.MOVING
    return tests.triangle(rows, k, ends, moves, time, origin, shear, slack, unit, limit)


@inlined
def _search(
    rows,
    ends,
    codes,
    nodes,
    last,
    links,
    sizes,
    spaces,
    trees,
    frames,
    i,
    stack,
    ahead,
    origin,
    direction,
    time,
    limit,
    unit,
    any_hit,
):
    """Return distance and row of the first hit of a ray, the limit and -1 without one."""
    one, never = rows.dtype.type(1), rows.dtype.type(np.inf)
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
        shear = tests.shear(d, inverse) if spaces[s, 5] > 0 else (0, one, one, one)
        for k in range(loose, stop):
            distance = _one(rows, ends, codes, k, o, d, time, squared, inverse, shear, slack, unit, limit)
            if distance > 0 and distance < limit:
                limit, found = distance, k
                if any_hit:
                    return limit, found
        for t in range(spaces[s, 3], spaces[s, 4]):
            limit, k = _walk(
                rows,
                ends,
                codes,
                nodes,
                last,
                links,
                trees[t, 0],
                trees[t, 1] != 0,
                trees[t, 2] != 0,
                stack,
                ahead,
                o,
                d,
                time,
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
                found = k
                if any_hit:
                    return limit, found
    return limit, found


@compiled(_nrt=False, nogil=True)
def search(world, names, rays, unit, any_hit, first, stop, stack, ahead, distances, numbers):
    """Search for the rays of a run: distances of their hits, the limits without one, and primitives, or -1.

    ``unit`` is the slack of a coordinate of 1. With ``any_hit`` the first hit that is found counts.
    """
    rows, ends, codes, nodes, last, links, sizes, spaces, trees, frames = world
    ox, oy, oz, dx, dy, dz, time, limit = rays
    never = limit.dtype.type(np.inf)
    for i in range(first, stop):
        distances[i], numbers[i] = limit[i], -1
        o, d = (ox[i], oy[i], oz[i]), (dx[i], dy[i], dz[i])
        dead = d[0] == 0 and d[1] == 0 and d[2] == 0
        if dead or not limit[i] > 0:
            continue
        if not (abs(o[0]) < never and abs(o[1]) < never and abs(o[2]) < never):
            continue
        distances[i], row = _search(
            rows,
            ends,
            codes,
            nodes,
            last,
            links,
            sizes,
            spaces,
            trees,
            frames,
            i,
            stack,
            ahead,
            o,
            d,
            time[i],
            limit[i],
            unit,
            any_hit,
        )
        if row >= 0:
            numbers[i] = names[row]
