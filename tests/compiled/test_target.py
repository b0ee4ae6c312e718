"""What is borrowed from inside Numba is there, is called as it was, and is not needed.

A version that fails here is not `target.KNOWN`: with it Numba makes the machine code by its own means.
"""

import json
import os
import subprocess
import sys
from functools import cache

import numba
import numpy as np
import pytest

from beaver_ftc import compiled
from beaver_ftc.compiled import target

# Where it is, and its arguments; none where only its name is used.
BORROWED = {
    "numba.core.cgutils:alloca_once_value": "(builder, value, name='', zfill=False)",
    "numba.core.cgutils:create_struct_proxy": "(fe_type, kind='value')",
    "numba.core.cgutils:if_likely": "(builder, pred)",
    "numba.core.cgutils:is_not_null": "(builder, val)",
    "numba.core.cgutils:add_global_variable": "(module, ty, name, addrspace=0)",
    "numba.core.cgutils:if_unlikely": "(builder, pred)",
    "numba.core.cgutils:is_null": "(builder, val)",
    "numba.core.cgutils:unpack_tuple": "(builder, tup, count=None)",
    "numba.core.codegen:CPUCodeLibrary.finalize": "(self)",
    "numba.core.codegen:CPUCodeLibrary._raise_if_finalized": "(self)",
    "numba.core.codegen:CPUCodeLibrary._optimize_final_module": "(self)",
    "numba.core.codegen:CPUCodeLibrary._finalize_final_module": "(self)",
    "numba.core.codegen:CPUCodeLibrary._get_module_for_linking": "(self)",
    "numba.core.codegen:JITCodeLibrary.get_pointer_to_function": "(self, name)",
    "numba.core.codegen:CPUCodegen._check_llvm_bugs": "(self)",
    "numba.core.codegen:CPUCodegen.magic_tuple": "(self)",
    "numba.core.compiler:CompileResult._rebuild": None,
    "numba.core.compiler:CompileResult._reduce": "(self)",
    "numba.core.compiler_lock:global_compiler_lock": None,
    "numba.core.cpu:CPUContext.get_getattr": "(self, typ, attr)",
    "numba.core.cpu:CPUContext.get_setattr": "(self, attr, sig)",
    "numba.core.datamodel:models.StructModel": None,
    "numba.core.datamodel:models.OpaqueModel": None,
    "numba.core.cpu:CPUContext.get_executable": "(self, library, fndesc, env)",
    "numba.core.cpu:CPUContext.insert_user_function": "(self, func, fndesc, libs=())",
    "numba.core.cpu:CPUContext.refresh": "(self)",
    "numba.core.cpu:CPUContext.get_python_api": "(self, builder)",
    "numba.core.dispatcher:Dispatcher.add_overload": "(self, cres)",
    "numba.core.dispatcher:Dispatcher.typeof_pyval": "(self, val)",
    "numba.core.dispatcher:_FunctionCompiler.compile": "(self, args, return_type)",
    "numba.core.imputils:RefType": None,
    "numba.core.imputils:impl_ret_borrowed": "(ctx, builder, retty, ret)",
    "numba.core.imputils:iternext_impl": "(ref_type=None)",
    "numba.core.imputils:lower_getattr_generic": "(ty)",
    "numba.core.imputils:lower_setattr_generic": "(ty)",
    "numba.core.pythonapi:NativeValue": None,
    "numba.core.pythonapi:PythonAPI.alloca_buffer": "(self)",
    "numba.core.pythonapi:PythonAPI.call_function_objargs": "(self, callee, objargs)",
    "numba.core.pythonapi:PythonAPI.extract_record_data": "(self, obj, pbuf)",
    "numba.core.pythonapi:PythonAPI.long_as_longlong": "(self, numobj)",
    "numba.core.pythonapi:PythonAPI.nrt_adapt_ndarray_from_python": "(self, ary, ptr)",
    "numba.core.pythonapi:PythonAPI.release_buffer": "(self, pbuf)",
    "numba.core.pythonapi:PythonAPI.serialize_object": "(self, obj)",
    "numba.core.pythonapi:PythonAPI.unserialize": "(self, structptr)",
    "numba.core.base:BaseContext.mangler": "(self, name, types, *, abi_tags=(), uid=None)",
    "numba.core.base:BaseContext.load_additional_registries": "(self)",
    "numba.core.codegen:CPUCodegen._create_empty_module": "(self, name)",
    "numba.core.codegen:JITCPUCodegen": None,
    "numba.core.cpu:CPUContext.init": "(self)",
    "numba.core.registry:CPUTarget": None,
    "numba.core.registry:cpu_target": None,
    "numba.core.target_extension:CPU": None,
    "numba.core.target_extension:dispatcher_registry": None,
    "numba.core.target_extension:jit_registry": None,
    "numba.core.target_extension:target_override": None,
    "numba.core.target_extension:target_registry": None,
    "numba.core.typing:Context": None,
    "numba.core.typing.context:BaseContext.insert_global": "(self, gv, gty)",
    "numba.core.typing.context:BaseContext.load_additional_registries": "(self)",
    "numba.core.types.functions:BaseFunction.augment": "(self, other)",
    "numba.core.types.functions:BaseFunction.get_call_type": "(self, context, args, kws)",
    "numba.core.utils:threadsafe_cached_property": None,
    "numba.core.registry:CPUDispatcher": None,
    "numba.core.runtime:rtsys.initialize": "(ctx)",
    "numba.core.serialize:dumps": "(obj)",
    "numba.core.sigutils:normalize_signature": "(sig)",
    "numba.core.types:unliteral": None,
    "numba.core.types:IterableType": None,
    "numba.core.types:SimpleIteratorType": None,
    "numba.core.typing.templates:AttributeTemplate": None,
    "numba.core.typing.templates:infer_getattr": "(item)",
    "numba.core.typing.templates:signature": "(return_type, *args, **kws)",
    "numba.np.arrayobj:make_array": "(array_type)",
    "numba.np.arrayobj:populate_array": None,
    "numba.np.arrayobj:raise_with_shape_context": "(src_shapes, index_shape)",
}
OF_A_LIBRARY = ("_codegen", "_final_module", "_finalized", "_linking_libraries", "_reload_init")
OF_A_DISPATCHER = (
    "_cache_hits",
    "_compiler",
    "_compiling_counter",
    "overloads",
    "targetctx",
    "targetoptions",
)

LOOK = """
import inspect, json, sys
from importlib import import_module
import numba
found = {}
for where in json.load(sys.stdin):
    module, _, path = where.partition(":")
    it = import_module(module)
    for name in path.split("."):
        it = getattr(it, name, None)
    found[where] = None if it is None else str(inspect.signature(it)) if inspect.isroutine(it) else ""
add = numba.njit(lambda x: x + 1.0)
add(1.0)
(result,) = add.overloads.values()
json.dump([found, sorted(vars(result.library)), sorted(dir(add))], sys.stdout)
"""


@cache
def numbas_own():
    """(arguments by name, what a library has, what a dispatcher has) where nothing is replaced."""
    given = json.dumps(list(BORROWED))
    done = subprocess.run(
        [sys.executable, "-c", LOOK], input=given, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


of_known = pytest.mark.skipif(not compiled.borrows(), reason="nothing is borrowed of this version")


@of_known
@pytest.mark.parametrize(("where", "arguments"), BORROWED.items(), ids=list(BORROWED))
def test_what_is_borrowed_is_there_with_its_arguments(where, arguments):
    found = numbas_own()[0][where]
    assert found is not None
    assert arguments in (None, found)


@of_known
def test_a_library_and_a_dispatcher_have_what_is_read_of_them():
    assert set(OF_A_LIBRARY) <= set(numbas_own()[1])
    assert set(OF_A_DISPATCHER) <= set(numbas_own()[2])


@pytest.mark.parametrize("version", ["0.67.2", "0.680.0", "1.0.0"])
def test_of_another_version_nothing_is_borrowed(monkeypatch, version):
    monkeypatch.setattr(numba, "__version__", version)
    assert not target.borrows.__wrapped__()


KERNELS = """
import sys
from pathlib import Path
import numpy as np
from beaver_ftc import compiled
from beaver_ftc.compiled import target

compiled.cache_folder = lambda: Path(__file__).parent / "cache"

@compiled.apart
def halve(record):
    record.value[:] = 0.5 * record.value

@compiled.kernel
def step(records, log):
    halve(records[0])
    row = compiled.row_of(log, 1)
    row[:] = records[0].value / 0.0
    return records[0].value.sum() / records.size

if __name__ == "__main__":
    records = np.zeros(1, [("before", "f8", (int(sys.argv[1]),)), ("value", "f8", (2,))])
    records["value"] = 3.0, -5.0
    log = np.zeros((2, 2))
    call = compiled.direct(step, records, log)
    print(call(records, log), *log[1], type(step).__name__, sum(step.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("compiler", ["", "numba"])
def test_kernels_come_to_the_same_either_way_and_are_kept(tmp_path, compiler):
    """Records of two shapes: the process that loads both must not take the code of one for the other's."""
    (tmp_path / "few_kernels.py").write_text(KERNELS)
    environment = {**os.environ, target.VARIABLE: compiler}

    def run(size):
        command = [sys.executable, tmp_path / "few_kernels.py", str(size)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return done.stdout.split(), done.stderr

    first, said = run(1)
    assert first == ["-1.0", "inf", "-inf", "Kernel", "0"]
    borrows = compiler == "" and compiled.borrows()
    assert ("code is compiled in a minute" in said) != borrows
    assert run(4)[0][:4] == first[:4]
    again, said = run(1)
    assert again[:4] == first[:4]
    assert said == ""
    kept = {path.name.partition("-")[0] for path in (tmp_path / "cache").glob("*-*")}
    assert kept == ({"step", "halve"} if borrows else {"step"})


def test_code_for_size_is_shorter_gives_the_same_and_is_kept_apart(tmp_path):
    def add_up(x, weights):
        for i in range(x.size):
            x[i] += weights[i] * x[i]
        return x[0]

    quick, short = (compiled.compile_into(tmp_path, add_up, for_size) for for_size in (False, True))
    given = np.arange(1.0, 10.0), np.linspace(0.5, 1.0, 9)
    x = given[0].copy()
    assert short(x, given[1]) == add_up(given[0], given[1])
    np.testing.assert_array_equal(x, given[0])
    quick(x, given[1])
    lines = [next(iter(each.overloads.values())).library.get_asm_str().count("\n") for each in (quick, short)]
    assert lines[1] < 0.8 * lines[0]
    assert len(list(tmp_path.glob("add_up-*"))) == 2
