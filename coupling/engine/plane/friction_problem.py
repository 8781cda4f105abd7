"""The problem of contact and Coulomb friction on accelerations, or on speeds: set up, solved, and its forces.

A contact that slips has the one unknown lambda_N; one that is at rest has three: lambda_N, the force lambda_R by which
its friction stays above -mu lambda_N, and the part a_L of its slip's acceleration to the left (Glocker and Pfeiffer
1996).
"""

from __future__ import annotations

import math

from vanedamp.coupling.numerics.compiler.jit import ZERO, inlined, kernel
from vanedamp.coupling.numerics.linear_complementarity import solve_lemke
from vanedamp.coupling.system.unit_kinematics import has_friction, is_rigid

#: unknowns of a contact: normal force, friction to the right, to the left, and the speed that it leaves
_NORMAL, _RIGHT, _LEFT, _SPEED = 1, 3, 4, 5


@kernel
def solve_rows(system, scratch, count, right, least, bound):
    """Solve the problem of the listed units: accelerations (or speeds) right + G forces, forces in scratch.impulse.

    right: (2u,) without the unknown forces; least: their least scale, per root of the
    diagonal of G; bound: (u,) of friction, to which mu times the unknown normal force is added. Returns False if there
    is no solution, or none is found.
    """
    u, problem, size = len(system.rest), scratch.lemke, 0
    scale = least
    for p in range(count):
        r = scratch.listed[p]
        scratch.place[p] = size
        if is_rigid(system, r):
            scale = max(scale, abs(right[r]) / math.sqrt(system.delassus[r, r]))
            size += 3 if scratch.way[p] == 0 and system.friction[r] > 0.0 else 1
        else:
            size += 2
        if system.delassus[u + r, u + r] > 0.0:
            scale = max(scale, abs(right[u + r]) / math.sqrt(system.delassus[u + r, u + r]))
            scale = max(scale, bound[r] * math.sqrt(system.delassus[u + r, u + r]))
    for r in range(2 * u):
        scratch.impulse[r] = 0.0
    if size == 0:
        return True
    scale = scale if scale > 0.0 else 1.0
    _set_up(system, scratch, count, right, bound, scale, size)
    if not solve_lemke(problem, size, scratch.attempt[0]) and not _solve_split(system, scratch, count, size):
        return False
    for p in range(count):
        r, i = scratch.listed[p], scratch.place[p]
        contact = is_rigid(system, r)
        if contact:
            scratch.impulse[r] = problem.z[i] * scale / math.sqrt(system.delassus[r, r])
            if scratch.way[p] != 0:
                scratch.impulse[u + r] = -scratch.way[p] * system.friction[r] * scratch.impulse[r]
        if scratch.way[p] == 0 and has_friction(system, r):
            low = bound[r] + (system.friction[r] * scratch.impulse[r] if contact else 0.0)
            above = problem.z[i + 1 if contact else i] * scale / math.sqrt(system.delassus[u + r, u + r])
            scratch.impulse[u + r] = above - low
    return True


@inlined
def _set_up(system, scratch, count, right, bound, scale, size):
    """Set up the problem (scratch.lemke) in numbers of size one."""
    u, problem = len(system.rest), scratch.lemke
    for i in range(size):
        problem.q[i] = 0.0
        for j in range(size):
            problem.matrix[i, j] = 0.0
    for p in range(count):
        r, i = scratch.listed[p], scratch.place[p]
        contact = is_rigid(system, r)
        at_rest = scratch.way[p] == 0 and has_friction(system, r)
        normal = 1.0 / math.sqrt(system.delassus[r, r]) if contact else 0.0
        slip = 1.0 / math.sqrt(system.delassus[u + r, u + r]) if at_rest else 0.0
        first = i + 1 if contact else i  # the unknown of the friction to the right
        if contact:
            problem.q[i] = _loaded(system, scratch, count, right, bound, r) * normal / scale
        if at_rest:
            problem.q[first] = _loaded(system, scratch, count, right, bound, u + r) * slip / scale
            problem.matrix[first, first + 1] += 1.0
            problem.matrix[first + 1, first] -= 1.0
            problem.q[first + 1] = 2.0 * bound[r] / (slip * scale)
            if contact:
                problem.matrix[first + 1, i] += 2.0 * system.friction[r] * normal / slip
        for o in range(count):
            c, j = scratch.listed[o], scratch.place[o]
            other = is_rigid(system, c)
            free = scratch.way[o] == 0 and has_friction(system, c)
            if other:
                weight = 1.0 / math.sqrt(system.delassus[c, c])
                drag = -system.friction[c] * (1.0 if free else float(scratch.way[o]))
                if contact:
                    entry = system.delassus[r, c] + drag * system.delassus[r, u + c]
                    problem.matrix[i, j] += normal * weight * entry
                if at_rest:
                    entry = system.delassus[u + r, c] + drag * system.delassus[u + r, u + c]
                    problem.matrix[first, j] += slip * weight * entry
            if free:
                k = j + 1 if other else j
                weight = 1.0 / math.sqrt(system.delassus[u + c, u + c])
                if contact:
                    problem.matrix[i, k] += normal * weight * system.delassus[r, u + c]
                if at_rest:
                    problem.matrix[first, k] += slip * weight * system.delassus[u + r, u + c]


@kernel
def _solve_split(system, scratch, count, size):
    """Solve the problem that is set up (scratch.lemke) by splitting each friction force in two, to the right and left.

    In this form, with an unknown more, Lemke's method finds a solution wherever the right-hand sides of contacts that
    do not slip yet are speeds or accelerations of one motion (Stewart and Trinkle 1996; Anitescu and Potra 1997); in
    the other not always. Returns False if it finds none.
    """
    many = _list_split(system, scratch, count)
    _set_up_split(scratch, many)
    if not solve_lemke(scratch.split, many, 0):
        return False
    _take_split(scratch, many, size)
    return True


@inlined
def _list_split(system, scratch, count):
    """List the unknowns (scratch.part, scratch.column). Returns their number."""
    part, of, many = scratch.part, scratch.column, ZERO
    for p in range(count):
        r, i = scratch.listed[p], scratch.place[p]
        if is_rigid(system, r):
            part[many], of[many] = _NORMAL, i
            many += 1
            i += 1
        if scratch.way[p] == 0 and has_friction(system, r):
            for kind in (_RIGHT, _LEFT, _SPEED):
                part[many], of[many] = kind, i
                many += 1
    return many


@inlined
def _set_up_split(scratch, many):
    """Set up the problem of the listed unknowns (scratch.split)."""
    one, two, part, of = scratch.lemke, scratch.split, scratch.part, scratch.column
    for a in range(many):
        row, way = of[a], -1.0 if part[a] == _LEFT else 1.0
        if part[a] == _SPEED:
            two.q[a] = 0.5 * one.q[row + 1]
        else:
            two.q[a] = one.q[row]
            for b in range(many):
                if part[b] == _SPEED:
                    two.q[a] += 0.5 * one.matrix[row, of[b]] * one.q[of[b] + 1]
            two.q[a] *= way
        for b in range(many):
            two.matrix[a, b] = _entry_of_split(scratch, many, a, b, way)


@inlined
def _entry_of_split(scratch, many, a, b, way):
    """Return an entry of the matrix; way: -1 in rows of friction to the left, otherwise 1."""
    matrix, part, row, column, total = scratch.lemke.matrix, scratch.part, scratch.column[a], scratch.column[b], 0.0
    if part[a] == _SPEED:
        if part[b] == _NORMAL:
            total = 0.5 * matrix[row + 1, column]
        elif (part[b] == _RIGHT or part[b] == _LEFT) and column == row:
            total = -1.0
    elif part[b] == _SPEED:
        total = 1.0 if column == row and part[a] != _NORMAL else 0.0
    else:
        total = matrix[row, column]
        if part[b] == _NORMAL and b + 1 < many and part[b + 1] == _RIGHT:
            # without the friction at its lower bound
            total += 0.5 * matrix[column + 2, column] * matrix[row, column + 1]
        total *= -way if part[b] == _LEFT else way
    return total


@inlined
def _take_split(scratch, many, size):
    """Set the solution of the problem with one friction force (scratch.lemke) from that with two."""
    one, two, part, of = scratch.lemke, scratch.split, scratch.part, scratch.column
    for a in range(many):
        if part[a] == _NORMAL:
            one.z[of[a]], one.w[of[a]] = two.z[a], two.w[a]
        elif part[a] == _SPEED:
            first, bound = of[a], two.q[a]
            if a >= 3 and part[a - 3] == _NORMAL:
                bound += two.matrix[a, a - 3] * two.z[a - 3]
            one.z[first] = max(bound + two.z[a - 2] - two.z[a - 1], 0.0)
            one.w[first + 1] = max(bound - two.z[a - 2] + two.z[a - 1], 0.0)
    for a in range(many):
        if part[a] == _SPEED:
            first, speed = of[a], one.q[of[a]]
            for j in range(size):
                if j != first + 1:
                    speed += one.matrix[first, j] * one.z[j]
            # to the left as far as the friction is at its right bound
            one.w[first], one.z[first + 1] = max(speed, 0.0), max(-speed, 0.0)


@inlined
def _loaded(system, scratch, count, right, bound, row):
    """The right side of a row: friction counts from its lower bound."""
    u, total = len(system.rest), right[row]
    for p in range(count):
        c = scratch.listed[p]
        if bound[c] > 0.0:
            total -= system.delassus[row, u + c] * bound[c]
    return total
