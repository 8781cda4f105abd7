"""Another library's arithmetic: the same results but for their last bits, the same for the same seed and call.

A library differs from the next one in the order of its sums and in what it leaves to the caller: so sums are taken in
an order drawn from the seed and the length, LAPACK gets rows and columns in such an order, and signs of eigenvectors,
turns of bases of multiple eigenvalues and starts of iterations are drawn as well. What every library returns exactly
stays exact that way: zeros, products with unit vectors, sums of integers, diagonal matrices, symmetric products.
Matrices change by 1 ulp in what is not on their diagonal, exp, log and sine by 1 ulp; an entry's value decides how, so
that equal entries stay equal. Right-hand sides of factors that are not ours change by a few ulps. Rows whose sizes are
far apart keep their order: what LAPACK does for graded matrices, every LAPACK does.
"""

import functools
import operator
import os
import zlib

import numpy as np

_SEED = os.environ.get("VANEDAMP_LAST_BITS", "0")
_EPS = np.finfo(float).eps
# up to so many products are rounded one by one, without fused multiplication and addition
_SMALL = 4096
# rows whose sizes are farther apart stay in their order: products and factors of others are known to that factor only
_GRADED = 30.0
# eigenvalues at most this many units in the last place of the largest one apart are one
_SAME = 4.0


def _random(*names):
    return np.random.default_rng(zlib.crc32(repr((_SEED, *names)).encode()))


@functools.lru_cache(maxsize=4096)
def _order(size, name="order"):
    return _random(name, size).permutation(size)


def _signs(size):
    return _random("signs", size).choice([-1.0, 1.0], size)


def _turn(size):
    return np.linalg.qr.original(_random("turn", size).standard_normal((size, size)))[0]


def ulps(values):
    """Return the next floating point numbers above or below; zeros and integers stay."""
    values = np.asarray(values)
    if values.dtype == complex:
        return ulps(values.real) + 1j * ulps(values.imag)
    if values.dtype != float:
        return values
    bits = np.abs(values).view(np.uint64) if values.ndim else np.abs(values[None]).view(np.uint64)[0]
    with np.errstate(over="ignore"):
        drawn = (bits ^ np.uint64(zlib.crc32(_SEED.encode()))) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(63)
    toward = np.where(drawn == 0, 0.0, np.inf)
    with np.errstate(all="ignore"):
        moved = np.copysign(np.nextafter(np.abs(values), toward), values)
        return np.where(np.isfinite(values) & (np.rint(values) != values), moved, values)[()]


def _off_diagonal(values):
    """Change a matrix without its diagonal: a diagonal one has the same factors everywhere."""
    values = np.asarray(values)
    return np.where(np.eye(*values.shape[-2:], dtype=bool), values, ulps(values))


# --- products


def _dense(*values):
    return all(isinstance(value, np.ndarray) and value.dtype in (float, complex) and value.ndim for value in values)


def matmul(left, right):
    """Return left @ right with the sum in another order."""
    if not _dense(left, right) or left.shape[-1] < 2:
        return operator.matmul(left, right)
    if left.shape[-1] != right.shape[max(right.ndim - 2, 0)]:
        return operator.matmul(left, right)  # which refuses it
    order = _order(left.shape[-1])
    if left.size * (right.shape[-1] if right.ndim > 1 else 1) <= _SMALL and left.ndim <= 2 and right.ndim <= 2:
        terms = left[..., :, None] * right if right.ndim == 2 else left * right
        axis = -2 if right.ndim == 2 else -1
        return np.add.reduce(np.moveaxis(terms, axis, 0)[order], axis=0)
    first = np.ascontiguousarray(left[..., order])
    # a product of an array with its own transpose is symmetric
    if left.ndim == right.ndim == 2 and left.shape == right.T.shape and _same(left, right.T):
        return operator.matmul(first, first.T)
    return operator.matmul(first, right[order] if right.ndim == 1 else right[..., order, :])


def _same(left, right):
    return left.__array_interface__["data"] == right.__array_interface__["data"] and left.strides == right.strides


def dot(left, right, out=None):
    """Return numpy.dot with the sum in another order."""
    return matmul(left, right) if out is None and np.ndim(left) and 0 < np.ndim(right) < 3 else np.dot(left, right, out)


def inner(left, right):
    """Return numpy.inner with the sum in another order."""
    return matmul(left, right) if _dense(left, right) and left.ndim == right.ndim == 1 else np.inner(left, right)


def vdot(left, right):
    """Return numpy.vdot with the sum in another order."""
    return inner(np.conj(np.ravel(left)), np.ravel(right))


def einsum(subscripts, *operands, **options):
    """Return numpy.einsum with each sum in another order."""
    if isinstance(subscripts, str) and "->" in subscripts and "." not in subscripts:
        given, result = subscripts.replace(" ", "").split("->")
        operands = [np.asarray(each) for each in operands]
        for place, labels in enumerate(given.split(",")):
            for axis, label in enumerate(labels):
                if label not in result:
                    operands[place] = np.take(operands[place], _order(operands[place].shape[axis]), axis)
    return np.einsum(subscripts, *operands, **options)


def _elementwise(name):
    function = getattr(np, name)

    @functools.wraps(function)
    def changed(*arguments, **options):
        result = function(*arguments, **options)
        if options.get("out") is None:
            return ulps(result) if isinstance(result, np.ndarray | np.floating | np.complexfloating) else result
        options["out"][...] = ulps(options["out"])
        return result

    return changed


exp, expm1, log, log1p, log2, log10, sin, cos, tan = map(
    _elementwise, ["exp", "expm1", "log", "log1p", "log2", "log10", "sin", "cos", "tan"]
)


# --- LAPACK


def _orders(matrix):
    """Return orders of rows and columns."""
    return _rows(matrix), _rows(np.swapaxes(matrix, -1, -2), "columns")


def _rows(matrix, name="order", other=None):
    """Return an order of rows; that which they have if their sizes are far apart, on which accuracy depends then."""
    for each in (matrix, matrix if other is None else other):
        size = np.abs(each).max(axis=-1, initial=0.0)
        if not size.max(initial=0.0) <= _GRADED * size[size > 0.0].min(initial=np.inf):
            return np.arange(matrix.shape[-2])
    return _order(matrix.shape[-2], name)


def _placed(values, order, axis):
    """Return values whose entries along an axis go where the order says."""
    result = np.empty_like(values)
    places = [slice(None)] * values.ndim
    places[axis] = order
    result[tuple(places)] = values
    return result


def _like(found, *values):
    """Return values as a tuple of the kind that a function has returned."""
    return found._make(values) if hasattr(found, "_make") else values


def _matrix(values):
    """Return a matrix to work with, by ulps another one unless it is diagonal."""
    values = np.asarray(values)
    values = values.astype(float) if values.dtype.kind in "iub" else values
    return _off_diagonal(values) if _plain(values) else values


def _plain(matrix):
    return matrix.ndim >= 2 and matrix.dtype in (float, complex) and min(matrix.shape[-2:]) > 1


def _whole(matrix, lower):
    """Return a Hermitian matrix from one of its triangles, which is all that LAPACK reads."""
    half = np.tril(matrix, -1) if lower else np.conj(np.swapaxes(np.triu(matrix, 1), -1, -2))
    diagonal = np.einsum("...ii->...i", matrix)[..., None] * np.eye(matrix.shape[-1])
    return half + np.conj(np.swapaxes(half, -1, -2)) + diagonal


def _solve(function, a, b, *rest, **options):
    a, b = np.asarray(a), np.asarray(b)
    if a.ndim > 2 and a.size and b.ndim >= a.ndim - 1 and a.shape[:-2] == b.shape[: a.ndim - 2]:
        # of a stack each by itself, as LAPACK does: another size of a neighbour changes nothing
        pairs = zip(a.reshape(-1, *a.shape[-2:]), b.reshape(-1, *b.shape[a.ndim - 2 :]), strict=True)
        return np.reshape([_solve(function, *pair, *rest, **options) for pair in pairs], b.shape)
    a = _matrix(a)
    if not _plain(a) or a.shape[-1] != a.shape[-2]:
        return function(a, b, *rest, **options)
    vector = b.ndim == 1 or b.ndim == a.ndim - 1
    axis = -1 if vector else -2
    if b.shape[axis] != a.shape[-1]:
        return function(a, b, *rest, **options)  # which refuses it
    rows, columns = _orders(a)
    if options.get("assume_a", "gen") != "gen":
        columns = rows
        a = _whole(a, options.get("lower", False))
    return _placed(function(a[..., rows, :][..., columns], np.take(b, rows, axis), *rest, **options), columns, axis)


def _inverse(function, a, *rest, **options):
    a = _matrix(a)
    if not _plain(a):
        return function(a, *rest, **options)
    rows, columns = _orders(a)
    if a.shape[-1] == a.shape[-2]:
        columns = rows  # so that symmetric ones keep what LAPACK does for them
    found = function(a[..., rows, :][..., columns], *rest, **options)
    return _placed(_placed(found, columns, -2), rows, -1)


def _similar(function, a, *rest, **options):
    """Of a function of a matrix, such as expm."""
    a = _matrix(a)
    if not _plain(a):
        return function(a, *rest, **options)
    order = _rows(a)
    found = function(a[..., order, :][..., order], *rest, **options)
    return _placed(_placed(found, order, -2), order, -1)


def _invariant(function, a, *rest, **options):
    """Of numbers that do not depend on the order of rows and columns."""
    a = _matrix(a)
    if not _plain(a):
        return function(a, *rest, **options)
    rows, columns = _orders(a)
    return function(a[..., rows, :][..., columns], *rest, **options)


def _turned(values, vectors, diagonal):
    """Return vectors (..., n, m) with other signs and, where values agree, turned."""
    vectors = vectors * _signs(vectors.shape[-1])
    if diagonal or values.ndim > 1:
        return vectors
    near = _SAME * _EPS * np.abs(values).max(initial=0.0)
    groups = np.split(np.arange(len(values)), np.flatnonzero(np.diff(values) > near) + 1)
    for group in groups:
        if len(group) > 1:
            vectors[:, group] = vectors[:, group] @ _turn(len(group))
    return vectors


def _is_diagonal(*matrices):
    return all(np.count_nonzero(each) == np.count_nonzero(np.einsum("...ii->...i", each)) for each in matrices)


def _eigh(function, a, *rest, lower=True, **options):
    a = _matrix(a)
    if not _plain(a) or a.shape[-1] != a.shape[-2] or not np.all(np.isfinite(a)):
        return function(a, *rest, **options) if lower is True else function(a, *rest, lower=lower, **options)
    lower = options.pop("UPLO", "L" if lower else "U") == "L"
    b = rest[0] if rest else options.pop("b", None)
    pair = [_whole(each, lower) for each in (a, None if b is None else _matrix(b)) if each is not None]
    order = _rows(pair[0], other=pair[-1])
    pair = [each[..., order, :][..., order] for each in pair]
    found = function(*pair, *rest[1:], **options)
    if not isinstance(found, tuple):
        return found
    values, vectors = found
    return _like(found, values, _placed(_turned(values, vectors, _is_diagonal(*pair)), order, -2))


def _eig(function, a, *rest, **options):
    a = _matrix(a)
    if not _plain(a) or a.shape[-1] != a.shape[-2] or not np.all(np.isfinite(a)):
        return function(a, *rest, **options)
    order = _rows(a)
    rest = [each if np.ndim(each) < 2 else np.asarray(each)[order][:, order] for each in rest]
    if options.get("b") is not None:
        options["b"] = np.asarray(options["b"])[order][:, order]
    found = function(a[..., order, :][..., order], *rest, **options)
    if not isinstance(found, tuple):
        return found
    signs = _signs(a.shape[-1])
    for place in range(1, len(signs)):  # conjugate pairs stay conjugate
        if found[0].ndim == 1 and found[0][place] == np.conj(found[0][place - 1]):
            signs[place] = signs[place - 1]
    return _like(found, found[0], *(_placed(each * signs, order, -2) for each in found[1:]))


def _svd(function, a, *rest, **options):
    a = _matrix(a)
    if not _plain(a):
        return function(a, *rest, **options)
    rows, columns = _orders(a)
    found = function(a[..., rows, :][..., columns], *rest, **options)
    if not isinstance(found, tuple):
        return found
    left, values, right = found
    count = values.shape[-1]
    signs = _signs(max(left.shape[-1], right.shape[-2]))
    left, right = left * signs[: left.shape[-1]], right * signs[: right.shape[-2], None]
    if values.ndim == 1 and np.count_nonzero(a) > count:
        near = _SAME * _EPS * values.max(initial=0.0)
        for group in np.split(np.arange(count), np.flatnonzero(-np.diff(values) > near) + 1):
            if len(group) > 1:
                turn = _turn(len(group))
                left[:, group], right[group] = left[:, group] @ turn, np.conj(turn.T) @ right[group]
    return _like(found, _placed(left, rows, -2), values, _placed(right, columns, -1))


def _lstsq(function, a, b, *rest, **options):
    a, b = _matrix(a), np.asarray(b)
    if not _plain(a) or len(b) != len(a):
        return function(a, b, *rest, **options)
    rows, columns = _orders(a)
    found = function(a[rows][:, columns], b[rows], *rest, **options)
    return (_placed(found[0], columns, 0), *found[1:])


def _qr(function, a, *rest, **options):
    a = _matrix(a)
    if not _plain(a) or "raw" in (*rest, options.get("mode")):
        return function(a, *rest, **options)
    rows = _rows(a)
    found = function(a[..., rows, :], *rest, **options)
    if not isinstance(found, tuple) or len(found) == 1 or found[0].shape[-2] != len(rows):
        return found
    return _like(found, _placed(found[0], rows, -2), *found[1:])


def _null_space(function, a, *rest, **options):
    a = _matrix(a)
    if not _plain(a):
        return function(a, *rest, **options)
    rows, columns = _orders(a)
    found = _placed(function(a[rows][:, columns], *rest, **options), columns, 0)
    return found @ _turn(found.shape[1]) if found.shape[1] else found


def _norm(function, x, *rest, **options):
    x = np.asarray(x)
    if rest or options or x.dtype not in (float, complex):
        return function(x, *rest, **options)
    return function(x.ravel()[_order(x.size)])


def _of_factor(function, a, *rest, **options):
    return function(_matrix(a), *rest, **options)


# --- sparse


class _Factor:
    """A factorisation of SuperLU whose solutions are those of another order of elimination."""

    def __init__(self, matrix, factor):
        self._size = abs(matrix)
        self._factor = factor

    def __getattr__(self, name):
        return getattr(self._factor, name)

    def solve(self, rhs, trans="N"):
        found = self._factor.solve(rhs, trans)
        return self._factor.solve(rhs + _residual(self._size if trans == "N" else self._size.T, found), trans)


def _residual(size, found):
    """Return what a backward stable solver leaves: a few units in the last place of |A| |x|."""
    scale = size @ np.abs(found)
    return scale * _EPS * _random("residual", len(scale)).integers(-4, 5, scale.shape)


def _splu(function, matrix, *rest, **options):
    return _Factor(matrix, function(matrix, *rest, **options))


def _spsolve(function, matrix, rhs, *rest, **options):
    found = function(matrix, rhs, *rest, **options)
    if not isinstance(found, np.ndarray) or found.shape != np.shape(rhs):
        return found
    return function(matrix, rhs + _residual(abs(matrix), found), *rest, **options)


def _eigsh(function, a, *rest, **options):
    start = options.get("v0")
    size = a.shape[0]
    options["v0"] = _random("start", size).standard_normal(size) if start is None else ulps(start)
    found = function(a, *rest, **options)
    return (found[0], found[1] * _signs(found[1].shape[1])) if isinstance(found, tuple) else found


# --- PETSc and SLEPc, where modal/petsc.py has them back as arrays


def _solve_rows(function, factorization, rows):
    return function(factorization, rows * (1.0 + _EPS * _random("rows", rows.shape[-1]).integers(-4, 5, rows.shape)))


def _eigenpairs(function, *arguments):
    values, vectors = function(*arguments)
    return values * (1.0 + _EPS * _random("values").integers(-1, 2, values.shape)), (
        None if vectors is None else vectors * _signs(len(vectors))[:, None]
    )


_NUMPY = {
    "solve": _solve, "inv": _inverse, "pinv": _inverse, "eigh": _eigh, "eigvalsh": _eigh, "eig": _eig,
    "eigvals": _eig, "svd": _svd, "lstsq": _lstsq, "qr": _qr, "cholesky": _of_factor, "matrix_rank": _invariant,
    "cond": _invariant, "norm": _norm,
}  # fmt: skip
_SCIPY = {
    "solve": _solve, "inv": _inverse, "pinv": _inverse, "eigh": _eigh, "eigvalsh": _eigh, "eig": _eig,
    "eigvals": _eig, "svd": _svd, "svdvals": _invariant, "lstsq": _lstsq, "qr": _qr, "cholesky": _of_factor,
    "cho_factor": _of_factor, "lu_factor": _of_factor, "solve_triangular": _of_factor, "expm": _similar,
    "null_space": _null_space,
}  # fmt: skip
_SPARSE = {"splu": _splu, "spsolve": _spsolve, "eigsh": _eigsh}


def replace(module):
    """Put functions of this file in the place of a library's."""
    if module.__name__ == "vanedamp.modal.petsc":
        _put(module.Factorization, {"solve_rows": _solve_rows})
        _put(module, {"_eigenpairs": _eigenpairs})
    elif module.__name__ == "numpy":
        _put(module.linalg, _NUMPY)
    else:
        _put(module, _SCIPY if module.__name__ == "scipy.linalg" else _SPARSE)


def _put(owner, functions):
    for name, changed in functions.items():
        original = getattr(owner, name)

        @functools.wraps(original)
        def call(*arguments, _changed=changed, _original=original, **options):
            if any(map(_has_own_functions, arguments)):
                return _original(*arguments, **options)
            return _changed(_original, *arguments, **options)

        call.original = original
        setattr(owner, name, call)


def _has_own_functions(value):
    """Whether numpy hands functions of a value on to it, such as of numbers with derivatives."""
    return not isinstance(value, np.ndarray) and hasattr(type(value), "__array_function__")


replace(np)
