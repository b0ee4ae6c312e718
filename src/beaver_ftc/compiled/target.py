"""Our kernels' own target of Numba's compiler, so that a first flight compiles in seconds, not in minutes.

Numba knows its targets by registries [numba.core.target_extension]: a class of target, the dispatcher of
its functions, and the contexts in which they are typed and translated. Ours inherit from those of Numba's
CPU target. Nothing of Numba is replaced: a function that somebody else compiles never comes here.

Machine code. Numba optimises a function again at each level of calls. Here a kernel that another one calls
is only translated; the outermost one is optimised once, with all that it calls (`Library`).

Kernels that only some flights call are called by their address, each compiled by itself when a flight first
calls it. The caller holds the address, zero at first; then Python finds or compiles the code. So a flight
compiles what it uses, and kernels that call the same one share its code.

Records have types that are the same for all sizes. To compiled code a record with room is its memory and the
places in it (records.py): a row of numbers, found by the record's own NumPy type each time that Python calls
compiled code. So a copy of a record, one from a file or another process brings its places along, and what
has none is refused. They never change: LLVM is told so, and need not look again after a write. Kernels of
ours alone see such a type. To anybody else's `@njit` the same record is what it is to Numba.

All that is borrowed from inside Numba is in this file, which is used with the versions in
`beaver_ftc.compiled.KNOWN` alone. With another, kernels are compiled by Numba's own means.
"""

import functools
import hashlib
import operator
import pickle
import zlib
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, serialize, sigutils, types, typing
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.datamodel import models
from numba.core.imputils import (
    RefType,
    impl_ret_borrowed,
    iternext_impl,
    lower_getattr_generic,
    lower_setattr_generic,
)
from numba.core.pythonapi import NativeValue
from numba.core.registry import CPUDispatcher, CPUTarget, cpu_target
from numba.core.runtime import rtsys
from numba.core.target_extension import (
    CPU,
    dispatcher_registry,
    jit_registry,
    target_override,
    target_registry,
)
from numba.core.types import unliteral
from numba.core.typing.templates import AttributeTemplate, infer_getattr, signature
from numba.core.utils import threadsafe_cached_property
from numba.extending import (
    intrinsic,
    lower_builtin,
    overload,
    overload_attribute,
    register_model,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array

from beaver_ftc.compiled import cache
from beaver_ftc.compiled.cache import CodeCache, announced, locked
from beaver_ftc.compiled.records import Part, Shape, places, shape_of

# mypy: disable-error-code="call-arg,override"


_WORD = ir.IntType(64)
_MEMORY, _PLACES = types.CPointer(types.uint8), types.CPointer(types.int64)


class _OfShape:
    """A type of this shape, whatever the size."""

    mutable = True

    def __init__(self, shape: Shape, *more: Any) -> None:
        self.shape = shape
        super().__init__(f"{type(self).__name__}({shape.digest})", *more)


class SizedRecord(_OfShape, types.Type):
    """A record."""

    def part(self, name: str) -> tuple[int, Part] | None:
        """The part of this name, and which of the places is its first."""
        first = 0
        for part in self.shape.parts:
            if part.name == name:
                return first, part
            first += part.n_places
        return None

    def typeof(self, name: str) -> Any:
        """The type of a field; None if there is none of this name."""
        found = self.part(name)
        if found is None:
            return fixed_part(self).fields[name].type if name in (self.shape.fixed.names or ()) else None
        part = found[1]
        if isinstance(part.of, Shape):
            return (SizedRecords if part.dims else SizedRecord)(part.of)
        return types.Array(numba.from_dtype(part.of), len(part.dims), "C")


class SizedRecords(_OfShape, types.IterableType):
    """Records one behind the other, all of one size."""

    @property
    def iterator_type(self) -> "SizedRecordsIterator":
        return SizedRecordsIterator(self.shape)


class SizedRecordsIterator(_OfShape, types.SimpleIteratorType):
    def __init__(self, shape: Shape) -> None:
        super().__init__(shape, SizedRecord(shape))


@functools.cache
def fixed_part(record: SizedRecord) -> Any:
    """Numba's own type of what is the same in all sizes."""
    return numba.from_dtype(record.shape.fixed)


def type_of(argument: Any) -> Any:
    """The type of a record or a row of records that have a size; None of anything else."""
    if isinstance(argument, np.void):
        return kind_of(argument.dtype, 0)
    if isinstance(argument, np.ndarray) and argument.flags.writeable:
        return kind_of(argument.dtype, argument.ndim)
    return None


def kind_of(dtype: np.dtype, dimensions: int) -> Any:
    """The type of a record, dimensions 0, or of a row of them; None if they have but one size."""
    shape = shape_of(dtype)
    return (SizedRecord, SizedRecords)[dimensions](shape) if shape and dimensions < 2 else None


def _register_struct(kind: Any, members: Callable[[Any], list[tuple[str, Any]]]) -> None:
    """Compiled code has of a value of this kind these members; members: of its type, names and types."""

    class _Model(models.StructModel):
        def __init__(self, manager: Any, of: Any) -> None:
            super().__init__(manager, of, members(of))

    register_model(kind)(_Model)


_RECORD = [("memory", _MEMORY), ("places", _PLACES)]
_register_struct(SizedRecord, lambda of: _RECORD)
_register_struct(SizedRecords, lambda of: [*_RECORD, ("count", types.intp), ("apart", types.intp)])
_register_struct(
    SizedRecordsIterator,
    lambda of: [("next", types.EphemeralPointer(types.intp)), ("records", SizedRecords(of.shape))],
)


def _struct(context: Any, builder: Any, kind: Any, value: Any = None) -> Any:
    return cgutils.create_struct_proxy(kind)(context, builder, value=value)


def _place(builder: Any, record: Any, k: int) -> Any:
    """Number k of the places."""
    found = builder.load(builder.gep(record.places, [_WORD(k)], inbounds=True))
    found.set_metadata("invariant.load", builder.module.add_metadata([]))
    return found


@infer_getattr
class _Fields(AttributeTemplate):
    key = SizedRecord

    def generic_resolve(self, record: Any, name: str) -> Any:
        return record.typeof(name)


@lower_getattr_generic(SizedRecord)
def _get(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    record, found = _struct(context, builder, kind, value), kind.part(name)
    if found is None:
        fixed = fixed_part(kind)
        there = builder.bitcast(record.memory, context.get_value_type(fixed))
        return context.get_getattr(fixed, name)(context, builder, fixed, there, name)
    first, part = found
    memory = builder.gep(record.memory, [_place(builder, record, first)], inbounds=True)
    wanted = kind.typeof(name)
    if isinstance(part.of, Shape):
        within = _struct(context, builder, wanted)
        within.memory, rest = memory, first + 1
        if part.dims:
            within.count, within.apart = (_place(builder, record, first + k) for k in (1, 2))
            rest = first + 3
        within.places = builder.gep(record.places, [_WORD(rest)], inbounds=True)
        return within._getvalue()
    return _array(context, builder, wanted, memory, list(_sizes(builder, record, part, first + 1)))


def _sizes(builder: Any, record: Any, part: Part, k: int) -> Iterator[Any]:
    for size in part.dims:
        yield _place(builder, record, k) if size is None else _WORD(size)
        k += size is None


def _array(context: Any, builder: Any, kind: Any, memory: Any, sizes: list[Any]) -> Any:
    """An array in a record, C-ordered, that nobody counts the users of."""
    data_type = context.get_data_type(kind.dtype)
    step = _WORD(context.get_abi_sizeof(data_type))
    item = step
    steps: list[Any] = []
    for size in reversed(sizes):
        steps.insert(0, step)
        step = builder.mul(step, size, flags=["nsw"])
    array = make_array(kind)(context, builder)
    data = builder.bitcast(memory, data_type.as_pointer())
    populate_array(array, data, sizes, steps, item, meminfo=None)
    return array._getvalue()


@lower_setattr_generic(SizedRecord)
def _set(context: Any, builder: Any, sig: Any, args: Any, name: str) -> None:
    kind, given = sig.args
    fixed = fixed_part(kind)
    if name not in fixed.fields:
        raise NotImplementedError(f"{name} cannot be assigned to: assign to its elements")
    record = _struct(context, builder, kind, args[0])
    there = builder.bitcast(record.memory, context.get_value_type(fixed))
    assign = context.get_setattr(name, signature(types.void, fixed, given))
    assign(builder, (there, args[1]))


def _at(context: Any, builder: Any, kind: Any, records: Any, i: Any) -> Any:
    record = _struct(context, builder, SizedRecord(kind.shape))
    record.memory = builder.gep(records.memory, [builder.mul(i, records.apart)], inbounds=True)
    record.places = records.places
    return record._getvalue()


@intrinsic
def _record_at(typingctx: Any, records: Any, i: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _at(context, builder, records, _struct(context, builder, records, args[0]), args[1])

    return SizedRecord(records.shape)(records, types.intp), codegen


@intrinsic
def _some_of(typingctx: Any, records: Any, first: Any, count: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        some = _struct(context, builder, records, args[0])
        some.memory = builder.gep(some.memory, [builder.mul(args[1], some.apart)], inbounds=True)
        some.count = args[2]
        return some._getvalue()

    return records(records, types.intp, types.intp), codegen


@intrinsic
def _count(typingctx: Any, records: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _struct(context, builder, records, args[0]).count

    return types.intp(records), codegen


def _counted(records):
    return _count(records)


@overload(len)
def _length(records):
    return _counted if isinstance(records, SizedRecords) else None


@overload_attribute(SizedRecords, "size")
def _size(records):
    return _counted


@overload(operator.getitem)
def _item(records, index):
    if not isinstance(records, SizedRecords):
        return None
    if isinstance(index, types.Integer):
        return lambda records, index: _record_at(records, index + (_count(records) if index < 0 else 0))
    if index == types.slice2_type:
        return _slice
    return None


def _slice(records, index):
    first, last, _ = index.indices(_count(records))
    return _some_of(records, first, max(last - first, 0))


@lower_builtin("getiter", SizedRecords)
def _iterator(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    iterator = _struct(context, builder, sig.return_type)
    iterator.next = cgutils.alloca_once_value(builder, context.get_constant(types.intp, 0))
    iterator.records = args[0]
    return impl_ret_borrowed(context, builder, sig.return_type, iterator._getvalue())


@lower_builtin("iternext", SizedRecordsIterator)
@iternext_impl(RefType.BORROWED)
def _next(context: Any, builder: Any, sig: Any, args: Any, result: Any) -> None:
    (kind,) = sig.args
    iterator, of = _struct(context, builder, kind, args[0]), SizedRecords(kind.shape)
    records = _struct(context, builder, of, iterator.records)
    i = builder.load(iterator.next)
    valid = builder.icmp_signed("<", i, records.count)
    result.set_valid(valid)
    with builder.if_then(valid):
        result.yield_(_at(context, builder, of, records, i))
        builder.store(builder.add(i, _WORD(1), flags=["nsw"]), iterator.next)


# digest, places and their address of each shape, for as long as the process: compiled code points there
_kept: dict[np.dtype, tuple[str, np.ndarray, int]] = {}


def _places_of(digest: str, argument: Any) -> int:
    """Where the places of a record or records of this shape lie."""
    dtype = argument.dtype
    if dtype not in _kept:
        shape = shape_of(dtype)
        found = np.fromiter(places(dtype) if shape else (), np.int64)
        _kept[dtype] = shape.digest if shape else "", found, found.ctypes.data
    of, _, address = _kept[dtype]
    if of != digest:
        raise TypeError("a record of another shape than this code was compiled for")
    return address


def _ask(c: Any, kind: Any, argument: Any) -> tuple[Any, Any]:
    """Code that finds the places, and whether that failed."""
    found, builder, python = cgutils.alloca_once_value(c.builder, _WORD(0)), c.builder, c.pyapi
    ask = functools.partial(_places_of, kind.shape.digest)
    asked = _held(builder, python.pyobj, lambda: python.unserialize(python.serialize_object(ask)))
    answer = python.call_function_objargs(asked, (argument,))
    failed = cgutils.is_null(builder, answer)
    with cgutils.if_likely(builder, builder.not_(failed)):
        builder.store(python.long_as_longlong(answer), found)
        python.decref(answer)
    return builder.inttoptr(builder.load(found), _WORD.as_pointer()), failed


def _held(builder: Any, kind: Any, make: Callable[[], Any]) -> Any:
    """Code that loads a value, zero at first; make: code that gives it the first time."""
    place = cgutils.add_global_variable(builder.module, kind, "held")
    place.linkage, place.initializer = "internal", ir.Constant(kind, None)
    with cgutils.if_unlikely(builder, cgutils.is_null(builder, builder.load(place))):
        builder.store(make(), place)
    return builder.load(place)


@unbox(SizedRecord)
def _unbox_record(kind: Any, given: Any, c: Any) -> NativeValue:
    record, buffer = _struct(c.context, c.builder, kind), c.pyapi.alloca_buffer()
    record.memory = c.pyapi.extract_record_data(given, buffer)
    no_data = cgutils.is_null(c.builder, record.memory)
    record.places, failed = _ask(c, kind, given)
    return NativeValue(
        record._getvalue(),
        cleanup=lambda: c.pyapi.release_buffer(buffer),
        is_error=c.builder.or_(no_data, failed),
    )


@unbox(SizedRecords)
def _unbox_records(kind: Any, given: Any, c: Any) -> NativeValue:
    records = _struct(c.context, c.builder, kind)
    builder = c.builder
    bytes_of = types.Array(types.uint8, 1, "A")
    array = make_array(bytes_of)(c.context, builder)
    there = builder.bitcast(array._getpointer(), c.pyapi.voidptr)
    code = c.pyapi.nrt_adapt_ndarray_from_python(given, there)
    records.memory = array.data
    (count,), (apart,) = (cgutils.unpack_tuple(builder, of, 1) for of in (array.shape, array.strides))
    records.count, records.apart = count, apart
    records.places, failed = _ask(c, kind, given)
    return NativeValue(
        records._getvalue(),
        cleanup=lambda: c.context.nrt.decref(builder, bytes_of, array._getvalue()),
        is_error=builder.or_(cgutils.is_not_null(builder, code), failed),
    )


# mypy: disable-error-code="attr-defined,misc"


compiling: list["Kernel"] = []  # kernels being compiled, each called by the one before; under Numba's lock


class Inner:
    """Stands for the machine code of a function that is compiled as a part of others only."""


class Library(JITCodeLibrary):
    """The code of one function. That of an inner one is only translated, for others to link in."""

    only_translated = False

    def finalize(self) -> None:
        """Optimise the code with all that it calls, unless it is a part of another."""
        self._raise_if_finalized()
        self.only_translated = self._finalized = len(compiling) > 1
        if self.only_translated:
            return
        self._codegen._check_llvm_bugs()
        own = {function.name for function in _defined(self._final_module)}
        for called in _all_called(self):
            self._reload_init.update(called._reload_init)
            self._final_module.link_in(called._get_module_for_linking(), preserve=True)
        for function in _defined(self._final_module):
            if function.name not in own:
                function.linkage = "internal"  # what is called in one place is then put there, however long
        if compiling and compiling[0].for_size:
            for function in _defined(self._final_module):
                function.add_function_attribute("optsize")
        self._optimize_final_module()
        self._final_module.verify()
        with cache.held():
            self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        """The module; with every function of one that was only translated, wanted so far or not."""
        if not self.only_translated:
            return super()._get_module_for_linking()
        module = self._final_module.clone()
        for function in _defined(module):
            function.linkage = "weak_odr"
        return module


def _defined(module: Any) -> list[Any]:
    return [function for function in module.functions if not function.is_declaration]


def _all_called(library: Any) -> list[Any]:
    """The libraries that this one calls, directly or through libraries that were only translated.

    A caller precedes what it calls, because LLVM links from a compiled library only the functions that are
    referenced by then.
    """
    found: dict[int, Any] = {}

    def visit(caller: Any) -> None:
        for called in caller._linking_libraries:
            if id(called) not in found:
                if getattr(called, "only_translated", False):
                    visit(called)
                found[id(called)] = called

    visit(library)
    return list(reversed(found.values()))


class Codegen(JITCPUCodegen):
    _library_class = Library


_known: dict[tuple[str, ...], Any] = {}


def stub(name: tuple[str, ...], kernel: Any) -> Callable[..., None]:
    """A function for Numba to compile, which calls this kernel by its address.

    name: module, function, and what else tells the kernel from others. Its arguments are records, arrays and
    numbers; it returns nothing.
    """
    _known[name] = kernel
    function = kernel.py_func
    arguments = ", ".join(f"argument_{i}" for i in range(function.__code__.co_argcount))
    space = {"call": _call(name), "__name__": function.__module__}
    exec(f"def {function.__name__}({arguments}): call(({arguments},))", space)
    made: Callable[..., None] = space[function.__name__]
    return made


def _address(name: tuple[str, ...], packed: bytes) -> int:
    """Where the code of this kernel lies, for arguments of the types packed."""
    import_module(name[0])
    kinds = pickle.loads(zlib.decompress(packed))
    result = _known[name].result(kinds)
    if result.signature.return_type != types.none:
        raise TypeError(f"{'.'.join(name)} returns something")
    with cache.held():
        where: int = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    return where


def _call(name: tuple[str, ...]) -> Any:
    """What stands for the call in compiled code, to be given the arguments as a tuple."""

    @intrinsic
    def call(typingctx: Any, arguments: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            kinds = tuple(arguments.types)
            ask = functools.partial(_address, name, zlib.compress(serialize.dumps(kinds)))
            code = _held(builder, _WORD, lambda: _asked(context, builder, ask))
            convention = context.call_conv
            prototype = convention.get_function_type(types.none, kinds)
            status, _ = convention.call_function(
                builder,
                builder.inttoptr(code, prototype.as_pointer()),
                types.none,
                kinds,
                cgutils.unpack_tuple(builder, values[0], len(kinds)),
            )
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(arguments), codegen

    return call


def _asked(context: Any, builder: Any, ask: Callable[[], int]) -> Any:
    """Code that asks Python for an address. An exception ends the call."""
    python = context.get_python_api(builder)
    lock = python.gil_ensure()
    asked = python.unserialize(python.serialize_object(ask))
    answer = python.call_function_objargs(asked, ())
    python.decref(asked)
    failed = cgutils.is_null(builder, answer)
    with cgutils.if_unlikely(builder, failed):
        python.gil_release(lock)
        context.call_conv.return_exc(builder)
    address = python.long_as_longlong(answer)
    python.decref(answer)
    python.gil_release(lock)
    return address


# mypy: disable-error-code="attr-defined,misc"


NAME = "beaver_ftc"  # of the target


class Target(CPU):
    """Numba's token of the target: what is meant for any target or for CPUs is meant for it too."""


class _Context(CPUContext):
    """How functions are translated: as by Numba, under names of ours."""

    def init(self) -> None:
        super().init()
        self._internal_codegen = Codegen(NAME)

    def load_additional_registries(self) -> None:
        """Numba's own implementations, imported once: Numba calls this for whatever it does not find."""
        for registry in self._registries:
            self.install_registry(registry)
        if not self._registries:
            rtsys.initialize(cpu_target.target_context)  # what all targets share, as if ours were not there
            super().load_additional_registries()
            _shorten_messages()

    def mangler(self, name: str, types: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
        """The name of a compiled function: after what its types contain.

        Numba names a record's type after how many types there were before in this process. Code that two
        processes have kept would then have the same names for records of two aircraft, and a third process
        that loads both would run the one for the other.
        """
        return super().mangler(name, (_digest_of(tuple(types)),), abi_tags=abi_tags, uid=uid)

    def get_executable(self, library: Any, fndesc: Any, env: Any) -> Any:
        """What Python calls; of an inner function what stands for it."""
        library._ensure_finalized()
        return Inner() if len(compiling) > 1 else super().get_executable(library, fndesc, env)


@functools.cache
def _digest_of(types: tuple[Any, ...]) -> str:
    return hashlib.sha256(repr(types).encode()).hexdigest()[:16]


class _Function(types.Function):
    """The type of an operator or of a function of NumPy; it keeps its signature for each set of arguments.

    Numba's own tries all definitions for each call in a kernel, once to type the call and again to translate
    it. It is also shared by all targets, and names the implementation of the target that asked last.
    """

    def __init__(self, template: Any) -> None:
        super().__init__(template)
        self._signatures: dict[Any, Any] = {}

    def augment(self, other: Any) -> Any:
        """The function with the definitions of both; None if they are different functions."""
        return type(self)(self.templates + other.templates) if other.typing_key == self.typing_key else None

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """The signature for arguments of these types."""
        if kws:
            return super().get_call_type(context, args, kws)
        key = tuple(args)
        if key not in self._signatures:
            self._signatures[key] = super().get_call_type(context, args, kws)
        return self._signatures[key]


register_model(_Function)(models.OpaqueModel)


class _TypingContext(typing.Context):
    """How functions are typed: as by Numba, each operator and function of NumPy once for the same types."""

    _loaded = False

    def load_additional_registries(self) -> None:
        """Numba's own declarations, once: it calls this again for each function that it compiles."""
        if not self._loaded:
            super().load_additional_registries()
            self._loaded = True

    def insert_global(self, value: Any, kind: Any) -> None:
        """Give a function, or another value, its type in kernels."""
        ours = _Function(kind.templates) if type(kind) is types.Function else kind
        super().insert_global(value, ours)


class _TargetOfKernels(CPUTarget):
    @threadsafe_cached_property
    def _toplevel_target_context(self) -> _Context:
        return _Context(self.typing_context, self._target_name)

    @threadsafe_cached_property
    def _toplevel_typing_context(self) -> _TypingContext:
        return _TypingContext()


target_registry[NAME] = Target
_target = _TargetOfKernels(NAME)


class Dispatcher(CPUDispatcher):
    """A function compiled for our target: ours, or one of those by which Numba implements NumPy."""

    targetdescr = _target

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled; what only stands for machine code cannot be called from Python."""
        if isinstance(cres.entry_point, Inner):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)


class Kernel(Dispatcher):
    """A kernel: kept by itself if Python calls it, and a part of the kernels that call it.

    for_size: whether its code, with all that is a part of it, is optimised for size.
    """

    def __init__(self, folder: Path | None, function: Callable[..., Any], for_size: bool = False) -> None:
        super().__init__(function, targetoptions={"nopython": True, "error_model": "numpy"})
        self.folder, self._cached = folder, folder and CodeCache(folder, function, for_size)
        self.for_size = for_size
        self._inner: set[tuple[Any, ...]] = set()  # arguments for which it is only a part of others so far
        self._results: dict[tuple[Any, ...], Any] = {}  # kept as long as the process: see `result`

    def compile(self, sig: Any) -> Any:
        """Machine code for arguments of these types; inside another kernel only what stands for it."""
        args, _ = sigutils.normalize_signature(sig)
        args = tuple(map(unliteral, args))  # a number in the text makes no other function of it
        with global_compiler_lock:
            if not compiling and (args in self._inner or not self.is_kept(args)):
                # Outside the counter: one of these may call this kernel, and would be refused as a recursion.
                cache.compile_expected()
            with self._compiling_counter:
                there = self.overloads.get(args)
                if there is not None and (compiling or args not in self._inner):
                    return there.entry_point
                if compiling:
                    return self._compiled_as_part(args)
                found = self._loaded(args)
                if found is None:
                    with self._alone(args):  # another process may have come first
                        found = self._loaded(args) or self._compile_and_keep(args)
                return found

    def typeof_pyval(self, val: Any) -> Any:
        """The type of an argument; in place of Numba's for records that have a size."""
        return type_of(val) or super().typeof_pyval(val)

    def stored(self, args: Any) -> Any:
        """The code an earlier process has kept, or None; found without making ready to compile."""
        rtsys.initialize(cpu_target.target_context)
        return self._cached and self._cached.load(tuple(args), self.targetctx)

    def result(self, args: Any) -> Any:
        """The code with what is known of it."""
        found = self._results.get(args) or self.stored(args)
        if found is None:
            self.compile(args)
            found = self.overloads[args]
        self._results[args] = found
        return found

    def _loaded(self, args: tuple[Any, ...]) -> Any:
        self.targetctx.refresh()
        found = self.stored(args)
        if found is None:
            return None
        self._cache_hits[args] += 1
        self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        return self._offered(args, found)

    def is_kept(self, args: tuple[Any, ...]) -> bool:
        """Whether nothing needs to be compiled for arguments of these types."""
        cached = self._cached
        return args in self.overloads or (
            isinstance(cached, CodeCache) and cached.has(args, self.targetctx.codegen())
        )

    @property
    def size(self) -> int:
        """How much its code follows from, in characters."""
        function: Any = self.py_func
        return len(cache.what_follows(function))

    def compile_unless_taken(self, args: tuple[Any, ...]) -> None:
        """Compile and keep the code, unless it is kept or another process compiles it now."""
        with global_compiler_lock, self._compiling_counter, self._alone(args, wait=False) as mine:
            if mine and not self.is_kept(args):
                self._compile_and_keep(args)

    def _alone(self, args: tuple[Any, ...], wait: bool = True) -> Any:
        """Keep other processes from compiling the same meanwhile: see `locked`."""
        place = self._cached.place(args, self.targetctx.codegen()) if self._cached else 0
        return locked(self.folder, place, wait)

    def _compile_and_keep(self, args: tuple[Any, ...]) -> Any:
        with announced(self.size):
            self.targetctx.refresh()
            result = self._translated(args, {"no_cfunc_wrapper": True})
            if self._cached:
                self._cached.save(args, result)
        return self._offered(args, result)

    def _compiled_as_part(self, args: tuple[Any, ...]) -> Any:
        result = self._translated(args, {"no_cfunc_wrapper": True, "no_cpython_wrapper": True})
        self._inner.add(args)
        self.overloads[args] = result
        return result.entry_point

    def _translated(self, args: tuple[Any, ...], wrappers: dict[str, bool]) -> Any:
        compiling.append(self)
        self._compiler.targetoptions = self.targetoptions | wrappers
        try:
            with target_override(NAME):
                return self._compiler.compile(args, None)
        finally:
            compiling.pop()

    def _offered(self, args: tuple[Any, ...], result: Any) -> Any:
        """The code, where Python and functions that Numba compiles by its own means find it."""
        cpu_target.target_context.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self._inner.discard(args)
        self.add_overload(result)
        return result.entry_point


def _jit(**options: Any) -> Callable[..., Dispatcher]:
    """The decorator of what Numba itself has compiled for our target."""
    return functools.partial(Dispatcher, targetoptions=options)


dispatcher_registry[Target] = Kernel
jit_registry[Target] = _jit


@functools.cache
def _shorten_messages() -> None:
    """Numba puts two arrays' shapes into the message that one cannot be assigned to the other: to compile its
    strings for that takes two seconds."""
    from numba.np.arrayobj import raise_with_shape_context

    @overload(raise_with_shape_context, target=NAME)
    def _raise(src_shapes, index_shape):
        def refuse(src_shapes, index_shape):
            raise ValueError("an array cannot be assigned to one of another shape")

        return refuse


def array_type(dtype: Any, dimensions: int) -> Any:
    """The type of a C-ordered array; of records that have a size, theirs."""
    return kind_of(dtype, dimensions) or types.Array(numba.from_dtype(dtype), dimensions, "C")


@intrinsic
def borrowed_row(typingctx, array, i):
    """Row i of an array (m, n) that nobody counts the users of: it must stay where it is meanwhile."""
    row_type = types.Array(array.dtype, 1, "C")

    def codegen(context, builder, signature, args):
        whole = make_array(signature.args[0])(context, builder, args[0])
        _, columns = cgutils.unpack_tuple(builder, whole.shape, 2)
        first = builder.gep(whole.data, [builder.mul(args[1], columns)])
        return _array(context, builder, row_type, first, [columns])

    return row_type(array, types.intp), codegen
