"""Code of compiled functions, linked as they are lowered and optimised once, in the function that Python calls.

numba optimises every function, emits machine code for it, and links it into its callers, where all of it is
optimised and emitted again: half of a first run's time for code that nobody calls. And it keeps with each function of
its cache the intermediate code of all that is below it, for callers that would inline it, which takes longer to load
than the machine code.

numba takes another compiler by a documented way (`pipeline_class`), and that one another library of code, whose methods
are numba's own but not documented; one function of numba is replaced, and does for other code what it did (`_index`).
Where a version of numba lacks one, this module raises ImportError, and numba's compiler is taken (jit.py):
slower, with the same results. numba's own means
do not replace it: numba 0.68 compiles the engine of sliders in 201 s instead of 41 s with its option `forceinline`;
without, in 47 s, and a period takes 2.3 us instead of 1.6 us.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import config, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.environment import lookup_environment
from numba.core.typed_passes import NopythonTypeInference
from numba.np import arrayobj

from vanedamp.coupling.numerics.compiler.record import RecordType

_METHODS = (
    "finalize", "get_pointer_to_function", "serialize_using_object_code", "_get_compiled_object",
    "_get_module_for_linking", "_optimize_final_module", "codegen",
)  # fmt: skip
_ENVIRONMENT = "_ZN08NumbaEnv"


class _FromZero(JITCodeLibrary):
    """Code whose indices count from the start of an array, as in C: none is negative, but a literal.

    numba adds the length to a negative index, wherever it cannot see that none is: with most indices, as they come out
    of arrays. That takes several instructions each, and keeps loops from taking several turns at once.
    """

    def create_ir_module(self, name: str) -> Any:
        """Return an empty module of a function, marked for `_index`."""
        module = super().create_ir_module(name)
        module.from_zero = True
        return module


_numbas_index: Any = getattr(arrayobj, "fix_integer_index", None)


def _index(context: Any, builder: Any, kind: Any, index: Any, length: Any) -> Any:
    """Return an index of an array as an address needs it, instead of numba's function."""
    if isinstance(index, ir.Constant) or not getattr(builder.module, "from_zero", False):
        return _numbas_index(context, builder, kind, index, length)
    return context.cast(builder, index, kind, types.intp)


class _Kernel(_FromZero):
    """Code of a function that only compiled functions call: it stays as it was lowered."""

    def finalize(self) -> None:
        """Leave the code to the callers."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0

    @property
    def codegen(self) -> _Kernel:
        """This library, which takes the function's environment: there is no machine code to hold it."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Leave the environment to the callers."""

    def lowered(self) -> Any:
        """Return this function's module."""
        return _whole(super()._get_module_for_linking())

    def _get_module_for_linking(self) -> Any:
        """Return the module of this function with all that it calls, for a library of numba's own."""
        module = self.lowered().clone()
        for library in _below(self):
            module.link_in(_module(library), preserve=True)
        return module


class _Loops(_Kernel):
    """Code of a function whose loops are long."""


class _Entry(_FromZero):
    """Code of a function that Python calls, with that of all functions below it.

    sized: whether it is compiled for the lengths of its records.
    """

    sized = False

    def finalize(self) -> None:
        """Link everything, optimise it, and make machine code."""
        self._own = [function.name for function in self._final_module.functions if not function.is_declaration]
        self._loops: set[str] = set()
        for library in _below(self):
            module = _module(library)
            if isinstance(library, _Loops):
                self._loops |= {function.name for function in module.functions if not function.is_declaration}
            self._final_module.link_in(module, preserve=True)
            self._reload_init.update(library._reload_init)
        self._linking_libraries = []
        super().finalize()
        for name in self._environments():
            self.codegen.set_env(name, lookup_environment(name))

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Return the machine code, and the names that it defines instead of the intermediate code.

        As variables, numba rejects missing ones at link time.
        """
        self._ensure_finalized()
        names = "\n".join(f'@"{name}" = global i8 0' for name in [*self._own, *self._environments()])
        return self.name, "object", (self._get_compiled_object(), llvm.parse_assembly(names).as_bitcode())

    def _environments(self) -> list[str]:
        """Return the names of the environments in the code."""
        names = [variable.name for variable in self._final_module.global_variables]
        return [name for name in names if name.startswith(_ENVIRONMENT) and lookup_environment(name) is not None]

    def _optimize_final_module(self) -> None:
        """Optimise the code, in which nobody else calls the functions below: so that unused arguments go.

        Unique names keep later code from being taken for this one.
        """
        apart = bool(self._loops) and not self.sized
        for number, function in enumerate(self._final_module.functions):
            if function.name in self._own and apart:
                # no vectors, which short loops pay for: long loops stay functions
                function.add_function_attribute("noimplicitfloat")
            if function.name in self._loops and apart:
                function.add_function_attribute("noinline")
            if not function.is_declaration and function.name not in self._own:
                function.linkage = llvm.Linkage.internal
                function.name = f"{self.name}.{number}"
        if not apart:
            super()._optimize_final_module()
            return
        # whole vectors one by one: by numba's means four at once, and what does not fill four number by number. Its
        # passes before the others are for reference counting
        tuning = llvm.create_pipeline_tuning_options()
        tuning.speed_level = config.OPT  # type: ignore[attr-defined]
        tuning.loop_vectorization, tuning.loop_interleaving = True, False
        builder = llvm.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


def _below(library: Any) -> Iterator[Any]:
    """Yield the libraries below one, each once."""
    seen, waiting = {library}, list(library._linking_libraries)
    while waiting:
        other = waiting.pop()
        if other in seen:
            continue
        seen.add(other)
        yield other
        if isinstance(other, _Kernel):  # others hold what they call
            waiting += other._linking_libraries


def _module(library: Any) -> Any:
    if isinstance(library, _Kernel):
        return library.lowered()
    return _whole(library._get_module_for_linking().clone())  # numba links its own as it is


def _whole(module: Any) -> Any:
    """Return a module of which nothing is left out because a module that calls it is linked later."""
    for function in module.functions:
        if function.linkage == llvm.Linkage.linkonce_odr:
            function.linkage = llvm.Linkage.weak_odr
    return module


def _compiler(library: type[JITCodeLibrary], name: str, inline: bool = False) -> type[CompilerBase]:
    """Return numba's compiler, with its code in a library of this class.

    inline: compile functions into all callers. As an option of numba's it would reach the builtin functions that they
    call, which would be compiled twice.
    """

    @register_pass(mutates_CFG=False, analysis_only=True)
    class Take(FunctionPass):
        """Choose the library before the code is lowered."""

        _name = f"vanedamp_{name}"

        def __init__(self) -> None:
            super().__init__()

        def run_pass(self, state: Any) -> bool:
            """Set the library, as the lowering would."""
            if state.library is None:
                state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
                state.library.enable_object_caching()
            state.flags.forceinline = inline
            if isinstance(state.library, _Entry):
                state.library.sized = any(isinstance(kind, RecordType) and kind.lengths for kind in state.args)
            return False

    class LibraryCompiler(CompilerBase):
        """numba's compiler but for the library."""

        def define_pipelines(self) -> list[Any]:
            """Return numba's pipeline with the choice of the library in it."""
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.add_pass_after(Take, NopythonTypeInference)
            passes.finalize()
            return [passes]

    return LibraryCompiler


if (
    not all(hasattr(JITCodeLibrary, name) for name in _METHODS)
    or not hasattr(llvm, "create_pipeline_tuning_options")
    or _numbas_index is None
):
    raise ImportError("this numba has another library of code")

arrayobj.fix_integer_index = _index
#: options of njit by kind of function
COMPILERS: dict[str, dict[str, Any]] = {
    "entry": {"pipeline_class": _compiler(_Entry, "entry")},
    "kernel": {"pipeline_class": _compiler(_Kernel, "kernel")},
    "inlined": {"pipeline_class": _compiler(_Kernel, "inlined", inline=True)},
    "loops": {"pipeline_class": _compiler(_Loops, "loops")},
}
