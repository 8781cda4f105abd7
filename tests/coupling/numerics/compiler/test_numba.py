"""What coupling/numerics/compiler takes for granted of numba, beyond what numba documents.

A numba that changes some of it fails here with one line that names the assumption. The checks import nothing of the
package, so that they run with any numba: put it first in PYTHONPATH.
"""

import inspect
import pickle
import subprocess
import sys

import numpy as np
import pytest

from tests.tools.processes import environment

_CHECKS = {}


def assumed(text):
    """Add a check: it returns whether numba is so; it may raise instead."""

    def added(check):
        _CHECKS[text] = check
        return check

    return added


def parameters(function):
    """Return the names of a function's parameters, without self."""
    return [name for name in inspect.signature(function).parameters if name != "self"]


def module(name="module"):
    """Return LLVM's code of a function f that returns its argument, parsed."""
    import llvmlite.binding as llvm

    return llvm.parse_assembly(f'source_filename = "{name}"\ndefine linkonce_odr i64 @f(i64 %0) {{\n  ret i64 %0\n}}\n')


def library(kind=None):
    """Return an empty library of code."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.registry import cpu_target

    return (kind or JITCodeLibrary)(cpu_target.target_context.codegen(), "library")


@assumed("njit takes the options _nrt, no_cfunc_wrapper, no_cpython_wrapper, and a set for fastmath")
def _options(folder):
    from numba import njit, types

    options = {"_nrt": False, "no_cfunc_wrapper": True, "error_model": "numpy", "fastmath": {"contract", "reassoc"}}
    njit(**options, no_cpython_wrapper=True)(lambda x: x).compile((types.float64,))
    return njit(**options)(lambda x: x)(2.0) == 2.0


@assumed("Dispatcher.overloads is keyed by the tuple of argument types, and an overload has an entry_point to call")
def _overloads(folder):
    from numba import njit, types

    compiled = njit(lambda x: x + 1)
    compiled.compile((types.int64,))
    return compiled.overloads[types.int64,].entry_point(2) == 3


@assumed("types.Dispatcher(function) is the type of a compiled function that is an argument of another")
def _dispatcher(folder):
    from numba import njit, types
    from numba.extending import typeof_impl

    class Wrapped:
        pass

    inner = njit(lambda x: 2 * x)
    typeof_impl.register(Wrapped)(lambda wrapped, context: types.Dispatcher(inner))
    return njit(lambda function, x: function(x))(Wrapped(), 3) == 6


@assumed("Dispatcher._cache: cache_path, _impl.filename_base, _cache_file, _load_overload(sig, target_context)")
def _cache(folder):
    from numba import njit

    kept = njit(cache=True)(parameters)._cache
    return (
        isinstance(kept.cache_path, str)
        and isinstance(kept._impl.filename_base, str)
        and hasattr(kept, "_cache_file")
        and parameters(kept._load_overload) == ["sig", "target_context"]
        and parameters(kept.load_overload) == ["sig", "target_context"]
    )


@assumed("_cache._guard_against_spurious_io_errors() is a context")
def _guard(folder):
    from numba import njit

    with njit(cache=True)(parameters)._cache._guard_against_spurious_io_errors():
        return True


def cache_file(folder):
    """Return numba's files of a function."""
    from numba.core.caching import IndexDataCacheFile

    return IndexDataCacheFile(str(folder), "name", "stamp")


@assumed("IndexDataCacheFile(cache_path, filename_base, source_stamp): load(key), save(key, data), _source_stamp")
def _files(folder):
    kept = cache_file(folder)
    kept.save("key", (b"digest", b"code"))
    return (
        parameters(type(kept)) == ["cache_path", "filename_base", "source_stamp"]
        and kept._source_stamp == "stamp"
        and kept.load("key") == (b"digest", b"code")
        and kept.load("other") is None
    )


@assumed("load and save of IndexDataCacheFile read the index by _load_index(), a dict of file names by key")
def _load_index(folder):
    from numba.core.caching import IndexDataCacheFile

    calls = []

    class Counted(IndexDataCacheFile):
        def _load_index(self):
            calls.append(dict(super()._load_index()))
            return dict(calls[-1])

    kept = Counted(str(folder), "name", "stamp")
    kept.save("key", 1)
    kept.load("key")
    return calls == [{}, {"key": "name.1.nbc"}]


@assumed("an index file NAME.nbi is the pickled version of numba, then the pickle of (stamp, names by key)")
def _index_layout(folder):
    import numba

    cache_file(folder).save("key", 1)
    with (folder / "name.nbi").open("rb") as index:
        return pickle.load(index) == numba.__version__ and pickle.load(index) == ("stamp", {"key": "name.1.nbc"})


@assumed("pickle reads what numba.core.serialize.dumps writes")
def _serialize(folder):
    from numba.core.serialize import dumps

    return pickle.loads(dumps(("x", b"y", 1))) == ("x", b"y", 1)


@assumed("JITCodeLibrary(codegen, name) has the methods that ours replace, with their parameters")
def _methods(folder):
    from numba.core.codegen import JITCodeLibrary

    expected = {
        "finalize": [], "get_pointer_to_function": ["name"], "serialize_using_object_code": [],
        "_get_compiled_object": [], "_get_module_for_linking": [], "_optimize_final_module": [],
        "_ensure_finalized": [], "enable_object_caching": [],
    }  # fmt: skip
    return (
        {name: parameters(getattr(JITCodeLibrary, name)) for name in expected} == expected
        and parameters(JITCodeLibrary) == ["codegen", "name"]
        and isinstance(JITCodeLibrary.codegen, property)
    )


@assumed("a library has _final_module, a list _linking_libraries, a set _reload_init, and _finalized")
def _attributes(folder):
    empty = library()
    return (
        empty._linking_libraries == []
        and empty._reload_init == set()
        and empty._finalized is False
        and list(empty._final_module.functions) == []
        and list(empty._final_module.global_variables) is not None
        and empty.name == "library"
    )


@assumed("JITCodeLibrary.finalize() optimises by _optimize_final_module(), once, and then there is machine code")
def _finalize(folder):
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler_lock import global_compiler_lock

    calls = []

    class Counted(JITCodeLibrary):
        def _optimize_final_module(self):
            calls.append([function.name for function in self._final_module.functions])
            super()._optimize_final_module()

    counted = library(Counted)
    counted.enable_object_caching()
    counted._final_module.link_in(keeping(module()), preserve=True)
    with global_compiler_lock:
        counted.finalize()
    address = counted.get_pointer_to_function("f")
    return calls == [["f"]] and address != 0 and len(counted._get_compiled_object()) > 0


def keeping(code):
    """Return code whose functions are kept though nothing calls them."""
    import llvmlite.binding as llvm

    for function in code.functions:
        function.linkage = llvm.Linkage.weak_odr
    return code


@assumed("serialize_using_object_code() is (name, 'object', (machine code, bitcode)), and unserialize_library takes it")
def _serialized(folder):
    from numba.core.compiler_lock import global_compiler_lock

    kept = library()
    kept.enable_object_caching()
    kept._final_module.link_in(keeping(module()), preserve=True)
    with global_compiler_lock:
        kept.finalize()
    name, kind, (code, bitcode) = kept.serialize_using_object_code()
    loaded = kept.codegen.unserialize_library((name, kind, (code, bitcode)))
    return (name, kind) == ("library", "object") and loaded.get_pointer_to_function("f") != 0


@assumed("llvmlite: code can be cloned, renamed, linked in, and its linkage and attributes changed")
def _binding(folder):
    import llvmlite.binding as llvm

    code = module()
    (function,) = code.clone().functions
    assert function.linkage == llvm.Linkage.linkonce_odr and not function.is_declaration
    (function,) = code.functions
    function.linkage = llvm.Linkage.internal
    function.name = "other"
    function.add_function_attribute("noinline")
    function.add_function_attribute("noimplicitfloat")
    return "noinline" in str(code) and "@other" in str(code)


def code_of(compiler):
    """Compile a function of one integer with a compiler of this class. Returns its overload."""
    from numba import njit, types

    compiled = njit(pipeline_class=compiler)(lambda x: x + 1)
    compiled.compile((types.int64,))
    return compiled.overloads[types.int64,]


def compiler_with(action):
    """Return numba's compiler with a pass between the inference of types and the lowering."""
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import FunctionPass, register_pass
    from numba.core.typed_passes import NopythonTypeInference

    @register_pass(mutates_CFG=False, analysis_only=True)
    class Take(FunctionPass):
        _name = "assumption"

        def __init__(self):
            super().__init__()

        def run_pass(self, state):
            action(state)
            return False

    class Chosen(CompilerBase):
        def define_pipelines(self):
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.add_pass_after(Take, NopythonTypeInference)
            passes.finalize()
            return [passes]

    return Chosen


@assumed("a pass after NopythonTypeInference sets state.library, of a class of its own, and the lowering takes it")
def _pass(folder):
    from numba.core.codegen import JITCodeLibrary

    class Own(JITCodeLibrary):
        pass

    def take(state):
        assert state.library is None
        state.library = Own(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()

    compiled = code_of(compiler_with(take))
    return isinstance(compiled.library, Own) and compiled.entry_point(1) == 2


@assumed("a pass finds the types of the arguments in state.args, and state.flags.forceinline is a flag")
def _state(folder):
    from numba import types

    seen = []

    def look(state):
        seen.append(tuple(state.args))
        state.flags.forceinline = True

    code_of(compiler_with(look))
    return seen == [(types.int64,)]


@assumed("environments are variables _ZN08NumbaEnv... of the code, found by lookup_environment, set by set_env")
def _environment(folder):
    from numba.core.compiler import Compiler
    from numba.core.environment import lookup_environment

    code = code_of(Compiler).library
    names = [each.name for each in code._final_module.global_variables if each.name.startswith("_ZN08NumbaEnv")]
    found = [name for name in names if lookup_environment(name) is not None]
    for name in found:
        code.codegen.set_env(name, lookup_environment(name))
    return bool(found)


@assumed("an event numba:compile starts before a function is compiled, and its listener may end the compilation")
def _event(folder):
    from numba import njit
    from numba.core import event

    class Refusal(event.Listener):
        def on_start(self, event):
            raise LookupError

        def on_end(self, event):
            pass

    compiled = njit(lambda x: x)
    with event.install_listener("numba:compile", Refusal()), pytest.raises(LookupError):
        compiled(1)
    return not compiled.overloads


@assumed("llvmlite.ir: a pointer knows its pointee, and loads carry metadata")
def _pointers(folder):
    from llvmlite import ir

    code = ir.Module()
    pointer = ir.LiteralStructType([ir.DoubleType(), ir.ArrayType(ir.IntType(64), 2)]).as_pointer()
    function = ir.Function(code, ir.FunctionType(ir.VoidType(), [pointer]), "f")
    builder = ir.IRBuilder(function.append_basic_block())
    loaded = builder.load(builder.gep(function.args[0], [ir.IntType(32)(0), ir.IntType(32)(0)], inbounds=True))
    loaded.set_metadata("invariant.load", code.add_metadata([]))
    builder.ret_void()
    return len(pointer.pointee) == 2 and "!invariant.load" in str(code)


@assumed("cgutils has gep_inbounds, alloca_once, alloca_once_value, false_bit, true_bit, unpack_tuple, pack_array")
def _cgutils(folder):
    from numba.core import cgutils

    return (
        parameters(cgutils.gep_inbounds)[:2] == ["builder", "ptr"]
        and parameters(cgutils.alloca_once)[:2] == ["builder", "ty"]
        and parameters(cgutils.alloca_once_value)[:2] == ["builder", "value"]
        and parameters(cgutils.unpack_tuple)[:2] == ["builder", "tup"]
        and parameters(cgutils.pack_array)[:2] == ["builder", "values"]
        and (cgutils.false_bit.constant, cgutils.true_bit.constant) == (0, 1)
    )


@assumed("models: data_model_manager[type] has from_data, as_data and get_data_type; PrimitiveModel takes a data type")
def _models(folder):
    from numba import types
    from numba.core.registry import cpu_target
    from numba.extending import models

    model = cpu_target.target_context.data_model_manager[types.boolean]
    return (
        parameters(models.PrimitiveModel) == ["dmm", "fe_type", "be_type"]
        and parameters(model.from_data) == ["builder", "value"]
        and parameters(model.as_data) == ["builder", "value"]
        and model.get_data_type() is not None
    )


@assumed("an array in compiled functions is a structure with shape, strides and nitems")
def _arrays(folder):
    from numba import types
    from numba.core.registry import cpu_target

    model = cpu_target.target_context.data_model_manager[types.float64[::1]]
    return {"shape", "strides", "nitems"} <= set(model._fields)


@assumed("a new type: unbox gives its value, generic_resolve a field's type, lower_getattr_generic its value")
def _fields(folder):
    from numba import njit, types
    from numba.core.typing.templates import AttributeTemplate
    from numba.extending import (
        NativeValue,
        infer_getattr,
        lower_getattr_generic,
        models,
        register_model,
        typeof_impl,
        unbox,
    )

    class Number:
        value = 3

    class Own(types.Type):
        @property
        def key(self):
            return "own"

    @register_model(Own)
    class _Model(models.PrimitiveModel):
        def __init__(self, manager, type):
            super().__init__(manager, type, manager.lookup(types.int64).get_data_type())

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = Own

        def generic_resolve(self, number, name):
            return types.int64 if name == "value" else None

    @lower_getattr_generic(Own)
    def get(context, builder, type, value, name):
        return builder.add(value, context.get_constant(types.int64, len(name)))

    @unbox(Own)
    def take(type, value, c):
        return NativeValue(c.unbox(types.int64, c.pyapi.object_getattr_string(value, "value")).value)

    typeof_impl.register(Number)(lambda number, context: Own("own"))
    return njit(lambda number: number.value)(Number()) == 3 + len("value")


@assumed("cfunc gives the address of a function of two numbers; by error_model numpy a division by zero is inf")
def _cfunc(folder):
    from ctypes import CFUNCTYPE, c_double

    from numba import cfunc, types

    compiled = cfunc(types.float64(types.float64, types.float64), error_model="numpy")(lambda x, y: x / y)
    return CFUNCTYPE(c_double, c_double, c_double)(compiled.address)(1.0, 0.0) == np.inf


@assumed("arrayobj.fix_integer_index(context, builder, idxty, idx, size) makes an integer an index, in every access")
def _index(folder):
    from numba import njit
    from numba.np import arrayobj

    numbas, calls = arrayobj.fix_integer_index, []

    def counted(*arguments):
        calls.append(arguments)
        return numbas(*arguments)

    def swap(x, i, j):
        x[i, 0], x[j, 0] = x[j, 0], x[i, 0]

    arrayobj.fix_integer_index = counted
    try:
        njit(swap)(np.zeros((2, 1)), 0, 1)
    finally:
        arrayobj.fix_integer_index = numbas
    return parameters(numbas)[1:2] == ["builder"] and len(calls) == 8 and hasattr(calls[0][1].module, "functions")


@assumed("a library makes its module by create_ir_module(name)")
def _create_ir_module(folder):
    from numba.core.codegen import JITCodeLibrary

    return parameters(JITCodeLibrary.create_ir_module) == ["name"]


@assumed("llvmlite: tuning options have speed_level, loop_vectorization, loop_interleaving; numba's codegen has _tm")
def _tuning(folder):
    import llvmlite.binding as llvm

    options = llvm.create_pipeline_tuning_options()
    options.speed_level, options.loop_vectorization, options.loop_interleaving = 3, True, False
    made, one = library(), module()
    builder = llvm.create_pass_builder(made.codegen._tm, options)
    builder.getModulePassManager().run(one, builder)
    return options.loop_interleaving is False


@pytest.mark.parametrize("text", _CHECKS, ids=[check.__name__.strip("_") for check in _CHECKS.values()])
def test_numba_is_as_assumed(text, tmp_path):
    import llvmlite
    import numba

    try:
        held, why = _CHECKS[text](tmp_path), ""
    except Exception as error:
        held, why = False, f": {type(error).__name__}: {error}"
    if not held:
        versions = f"numba {numba.__version__}, llvmlite {llvmlite.__version__}"
        pytest.fail(f"{versions} no longer holds to: {text}{why}".replace("\n", " "), pytrace=False)


def test_the_package_compiles_by_its_own_code_library():
    """Where a numba lacks what it needs, it takes numba's compiler in silence: slower, with the same results."""
    from vanedamp.coupling.numerics.compiler import code_library, jit

    assert jit.COMPILERS is code_library.COMPILERS


def test_another_numba_compiles_by_its_own_means(tmp_path):
    """Without the modules that stand on what it does not document; nothing is kept then, as its date would not do."""
    (tmp_path / "compiled.py").write_text("""
import sys

for name in ("code_library", "code_file"):
    sys.modules[f"vanedamp.coupling.numerics.compiler.{name}"] = None
from vanedamp.coupling.numerics.compiler.jit import entry, kernel

@kernel
def twice(x):
    return 2.0 * x

@entry
def more(x):
    return twice(x) + 1.0

print(more(3.0))
""")
    folder = {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    done = subprocess.run(
        [sys.executable, "compiled.py"], cwd=tmp_path, env=environment(**folder), capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ("7.0\n", "")
    assert not list(tmp_path.rglob("*.nb?"))


def test_other_code_counts_negative_indices_from_the_end():
    """Ours never does, but for literals: where numba makes an index, it asks whose code it is."""
    from numba import njit

    from vanedamp.coupling.numerics.compiler.jit import entry

    @entry
    def last(x, i):
        return 10 * x[-1] + x[i]

    x = np.arange(3)
    assert njit(lambda x, i: x[i])(x, -1) == 2
    assert last(x, 1) == 21
