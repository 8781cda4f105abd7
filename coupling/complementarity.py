"""The complementarity problem of contact and friction, solved exactly.

Accelerations (or velocities) of rows are a = A f + b with A symmetric and positive semidefinite, and each force obeys

    a_i = 0 with lo_i <= f_i <= hi_i,    a_i > 0 with f_i = lo_i,    a_i < 0 with f_i = hi_i.

A contact has lo = 0, hi = inf; Coulomb friction at zero slip has lo = -mu N, hi = mu N (Pfeiffer and Glocker 1996).
The principal pivoting of Dantzig and of Baraff (1994) brings in one row after the other and never loses a condition.
"""

from __future__ import annotations

import numpy as np

from coupling.compiled import kernel

OUT, FREE, AT_LOW, AT_HIGH, DEPENDENT = 0, 1, 2, 3, 4
_ROUND_OFF = 1e-11
_DEPENDENCE = 1e-9


@kernel
def solve_box(a_matrix, b, lo, hi, forced, f, a, state):
    """Solve in place: forces f and accelerations a (both shape (k,)), state FREE, AT_LOW, AT_HIGH or DEPENDENT.

    forced: 0, or AT_LOW / AT_HIGH for a row whose force has just reached that bound on its way out: it stays there.
    DEPENDENT rows are at rest because FREE rows hold them; their force keeps its value within the bounds.
    Returns False if the budget of pivots is spent (never seen for positive semidefinite A; a guard).
    """
    k = len(b)
    for i in range(k):
        f[i] = 0.0
        state[i] = OUT
    for i in range(k):
        if forced[i] == AT_LOW:
            f[i], state[i] = lo[i], AT_LOW
        elif forced[i] == AT_HIGH:
            f[i], state[i] = hi[i], AT_HIGH
    scale = 0.0
    for i in range(k):
        a[i] = b[i]
        for j in range(k):
            a[i] += a_matrix[i, j] * f[j]
        scale = max(scale, abs(a[i]), abs(b[i]))
    done = True
    for i in range(k):
        if state[i] == OUT:
            done = _drive(a_matrix, lo, hi, forced, f, a, state, i, _ROUND_OFF * scale) and done
    tolerance = _ROUND_OFF * scale
    for i in range(k):
        if state[i] != FREE and abs(a[i]) <= tolerance and _dependent(a_matrix, state, i):
            state[i] = DEPENDENT
    return done


@kernel
def _drive(a_matrix, lo, hi, forced, f, a, state, i, tolerance):
    """Move f_i until row i obeys its condition, keeping the conditions of all rows that are in."""
    k = len(f)
    df, da = np.zeros(k), np.zeros(k)
    for _ in range(50 + 20 * k):
        if abs(a[i]) <= tolerance:
            if _dependent(a_matrix, state, i):
                state[i] = DEPENDENT
            else:
                state[i] = FREE
            a[i] = 0.0
            return True
        way = 1.0 if a[i] < 0.0 else -1.0
        bound = hi[i] if way > 0.0 else lo[i]
        if f[i] == bound:
            state[i] = AT_HIGH if way > 0.0 else AT_LOW
            return True
        _response(a_matrix, state, i, way, df, da)
        step, who = (bound - f[i]) * way, i
        at_bound = True
        if da[i] * way > 0.0 and -a[i] / da[i] <= step:
            step, at_bound = -a[i] / da[i], False
        for j in range(k):
            if j == i or state[j] == OUT:
                continue
            if state[j] == FREE and df[j] != 0.0:
                room = ((hi[j] if df[j] > 0.0 else lo[j]) - f[j]) / df[j]
                if room < step:
                    step, who, at_bound = max(room, 0.0), j, True
            elif state[j] == DEPENDENT:
                # a row that FREE rows held takes over at once when they no longer do
                if abs(da[j]) > _DEPENDENCE * np.sqrt(a_matrix[i, i] * a_matrix[j, j]):
                    step, who, at_bound = 0.0, j, False
            elif forced[j] == 0 and ((state[j] == AT_LOW and da[j] < 0.0) or (state[j] == AT_HIGH and da[j] > 0.0)):
                room = max(-a[j] / da[j], 0.0)
                if room < step and not _dependent_with(a_matrix, state, j, i):
                    step, who, at_bound = room, j, False
        if step == np.inf:
            return False
        for j in range(k):
            f[j] += step * df[j]
            a[j] += step * da[j]
        if who != i and at_bound:
            state[who] = AT_HIGH if df[who] > 0.0 else AT_LOW
            f[who] = hi[who] if df[who] > 0.0 else lo[who]
        elif who != i:
            state[who] = FREE
            a[who] = 0.0
        elif at_bound:
            f[i] = bound
            state[i] = AT_HIGH if way > 0.0 else AT_LOW
            return True
        else:
            a[i] = 0.0
            state[i] = FREE
            return True
    return False


@kernel
def _response(a_matrix, state, i, way, df, da):
    """Change of all forces and accelerations as f_i moves by `way` and the FREE rows keep their acceleration."""
    k = len(df)
    df[:] = 0.0
    df[i] = way
    free = _free(state, i)
    if len(free):
        solution = _solve(a_matrix, free, a_matrix[:, i] * -way)
        for p in range(len(free)):
            df[free[p]] = solution[p]
    for j in range(k):
        da[j] = 0.0
        for l in range(k):
            da[j] += a_matrix[j, l] * df[l]
    for p in range(len(free)):
        da[free[p]] = 0.0
    if da[i] * way <= _DEPENDENCE * a_matrix[i, i]:
        da[i] = 0.0


@kernel
def _free(state, but):
    count = 0
    for j in range(len(state)):
        if state[j] == FREE and j != but:
            count += 1
    free = np.empty(count, np.int64)
    count = 0
    for j in range(len(state)):
        if state[j] == FREE and j != but:
            free[count] = j
            count += 1
    return free


@kernel
def _dependent(a_matrix, state, i):
    return _schur(a_matrix, _free(state, i), i) <= _DEPENDENCE * a_matrix[i, i]


@kernel
def _dependent_with(a_matrix, state, j, i):
    """Whether row j would depend on the FREE rows together with row i."""
    free = _free(state, j)
    both = np.empty(len(free) + 1, np.int64)
    both[: len(free)] = free
    both[-1] = i
    if _schur(a_matrix, free, i) <= _DEPENDENCE * a_matrix[i, i]:
        return _schur(a_matrix, free, j) <= _DEPENDENCE * a_matrix[j, j]
    return _schur(a_matrix, both, j) <= _DEPENDENCE * a_matrix[j, j]


@kernel
def _schur(a_matrix, free, i):
    rest = a_matrix[i, i]
    if len(free):
        solution = _solve(a_matrix, free, a_matrix[:, i])
        for p in range(len(free)):
            rest -= a_matrix[i, free[p]] * solution[p]
    return rest


@kernel
def _solve(a_matrix, free, right):
    """A_ff x = right_f by Cholesky; the free rows are independent by construction."""
    m = len(free)
    factor = np.empty((m, m))
    x = np.empty(m)
    for p in range(m):
        for q in range(p + 1):
            total = a_matrix[free[p], free[q]]
            for l in range(q):
                total -= factor[p, l] * factor[q, l]
            factor[p, q] = np.sqrt(max(total, 1e-300)) if p == q else total / factor[q, q]
        total = right[free[p]]
        for l in range(p):
            total -= factor[p, l] * x[l]
        x[p] = total / factor[p, p]
    for p in range(m - 1, -1, -1):
        total = x[p]
        for l in range(p + 1, m):
            total -= factor[l, p] * x[l]
        x[p] = total / factor[p, p]
    return x
