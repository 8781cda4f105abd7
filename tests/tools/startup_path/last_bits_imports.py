"""Import hooks: vanedamp with calls of `last_bits_arithmetic` in place of `@` and of numpy's functions.

The operator `@` of arrays cannot be replaced, but the modules that use it can be compiled with a call instead. Compiled
functions (numba's) stay as they are written. Imports nothing heavy: each process starts with it.
"""

import ast
import hashlib
import importlib.util
import os
import sys
from importlib.machinery import PathFinder, SourceFileLoader
from pathlib import Path

SEED = "VANEDAMP_LAST_BITS"
_PACKAGES = ("vanedamp.", "tests.tools.", "tests.reference.", "tests.validation.")
#: modules whose functions are replaced once they are loaded
_LIBRARIES = ("numpy", "scipy.linalg", "scipy.sparse.linalg")
#: functions of numpy that have a namesake in `last_bits_arithmetic`
_FUNCTIONS = {
    "dot", "inner", "vdot", "matmul", "einsum", "exp", "expm1", "log", "log1p", "log2", "log10", "sin", "cos", "tan",
}  # fmt: skip
#: decorators of functions that numba compiles; those of contact laws are static methods
_COMPILED = {"entry", "kernel", "inlined", "summing", "comparing", "intrinsic", "njit", "overload", "staticmethod"}
_HERE = Path(__file__)
# modules compiled with other code are kept apart, by what compiles them
CACHE = _HERE.parents[3] / ".cache" / "last-bits" / hashlib.sha256(_HERE.read_bytes()).hexdigest()[:16]


def install() -> None:
    """Perturb the arithmetic of this process from now on, if the environment names a seed."""
    if not os.environ.get(SEED) or any(isinstance(finder, _Finder) for finder in sys.meta_path):
        return
    if str(_HERE.parent) not in sys.path:
        sys.path.append(str(_HERE.parent))
    sys.meta_path.insert(0, _Finder())
    for name in _LIBRARIES:
        if name in sys.modules:
            _perturb(sys.modules[name])


def _perturb(module):
    import last_bits_arithmetic

    if module.__name__ != "numpy":  # which that file needs itself, and perturbs at its end
        last_bits_arithmetic.replace(module)


class _Finder:
    """Finds modules as Python does, and gives them another loader."""

    def find_spec(self, name, path=None, target=None):
        ours = name.startswith(_PACKAGES)
        if not ours and name not in _LIBRARIES:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = (_Perturbed if ours else _Library)(name, spec.loader.path)
        return spec


class _Library(SourceFileLoader):
    def exec_module(self, module):
        super().exec_module(module)
        _perturb(module)


class _Perturbed(SourceFileLoader):
    def get_code(self, fullname):
        before, sys.pycache_prefix = sys.pycache_prefix, str(CACHE)
        try:
            return super().get_code(fullname)
        finally:
            sys.pycache_prefix = before

    def source_to_code(self, data, path, *, _optimize=-1):
        tree = ast.parse(importlib.util.decode_source(data), path)
        change(tree)
        return compile(tree, path, "exec", dont_inherit=True, optimize=_optimize)

    def exec_module(self, module):
        super().exec_module(module)
        if module.__name__ == "vanedamp.modal.petsc":
            _perturb(module)


def change(tree):
    """Put the calls into a module's tree."""
    calls = _Calls()
    calls.visit(tree)
    if calls.count:
        # after the docstring and `from __future__`
        first = next((place for place, node in enumerate(tree.body) if not _is_head(node)), len(tree.body))
        tree.body.insert(first, ast.parse("import last_bits_arithmetic as _last_bits").body[0])
    ast.fix_missing_locations(tree)


def _is_head(node):
    return isinstance(node, ast.Expr) or (isinstance(node, ast.ImportFrom) and node.module == "__future__")


class _Calls(ast.NodeTransformer):
    """Puts `_last_bits.matmul(a, b)` for `a @ b`, and `_last_bits.exp` for `np.exp`, outside of compiled functions."""

    def __init__(self):
        self.count = 0

    def visit_FunctionDef(self, node):
        for decorator in node.decorator_list:
            named = decorator.func if isinstance(decorator, ast.Call) else decorator
            if getattr(named, "id", getattr(named, "attr", "")) in _COMPILED:
                return node
        return self.generic_visit(node)

    def visit_BinOp(self, node):
        self.generic_visit(node)
        if not isinstance(node.op, ast.MatMult):
            return node
        return ast.copy_location(ast.Call(self._name("matmul"), [node.left, node.right], []), node)

    def visit_Attribute(self, node):
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and node.value.id == "np" and node.attr in _FUNCTIONS:
            return ast.copy_location(self._name(node.attr), node)
        return node

    def _name(self, name):
        self.count += 1
        return ast.Attribute(ast.Name("_last_bits", ast.Load()), name, ast.Load())
