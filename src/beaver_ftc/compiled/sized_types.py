"""Numba's types of records whose parts change in size, so that compiled code is the same for all sizes.

To compiled code a record with room is its memory and the places in it (records.py): a row of numbers, found
by the record's own NumPy type each time that Python calls compiled code. So a copy of a record, one from a
file or another process brings its places along, and what has none is refused. They never change: LLVM is told
so, and need not look again after a write. Kernels of ours alone see such a type. To anybody else's `@njit`
the same record is what it is to Numba.

Borrowed from inside Numba, like target.py, and used with the same versions.
"""

import functools
import operator
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.imputils import (
    RefType,
    impl_ret_borrowed,
    iternext_impl,
    lower_getattr_generic,
    lower_setattr_generic,
)
from numba.core.pythonapi import NativeValue
from numba.core.typing.templates import AttributeTemplate, infer_getattr, signature
from numba.extending import (
    intrinsic,
    lower_builtin,
    overload,
    overload_attribute,
    register_model,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array

from beaver_ftc.compiled.asking import WORD, held_value, number_from_python
from beaver_ftc.compiled.records import Part, Shape, places, shape_of

# mypy: disable-error-code="call-arg,override,attr-defined,misc"


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
    """The members of a value of this kind; without a value, members to be filled."""
    return cgutils.create_struct_proxy(kind)(context, builder, value=value)


def _place(builder: Any, record: Any, k: int) -> Any:
    """Number k of the places."""
    found = builder.load(builder.gep(record.places, [WORD(k)], inbounds=True))
    found.set_metadata("invariant.load", builder.module.add_metadata([]))
    return found


@infer_getattr
class _Fields(AttributeTemplate):
    key = SizedRecord

    def generic_resolve(self, record: Any, name: str) -> Any:
        return record.typeof(name)


@lower_getattr_generic(SizedRecord)
def _get(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """A field: by Numba's own means if it is the same in all sizes; else a record, records or an array that
    begins, and is as long, as the places say."""
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
        within.places = builder.gep(record.places, [WORD(rest)], inbounds=True)
        return within._getvalue()
    return _array(context, builder, wanted, memory, list(_sizes(builder, record, part, first + 1)))


def _sizes(builder: Any, record: Any, part: Part, k: int) -> Iterator[Any]:
    """The sizes of an array: those that are given, and from place k on those that are not."""
    for size in part.dims:
        yield _place(builder, record, k) if size is None else WORD(size)
        k += size is None


def _array(context: Any, builder: Any, kind: Any, memory: Any, sizes: list[Any]) -> Any:
    """An array in a record, C-ordered, that nobody counts the users of."""
    data_type = context.get_data_type(kind.dtype)
    step = WORD(context.get_abi_sizeof(data_type))
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
    """Assign to a field that is the same in all sizes."""
    kind, given = sig.args
    fixed = fixed_part(kind)
    if name not in fixed.fields:
        raise NotImplementedError(f"{name} cannot be assigned to: assign to its elements")
    record = _struct(context, builder, kind, args[0])
    there = builder.bitcast(record.memory, context.get_value_type(fixed))
    assign = context.get_setattr(name, signature(types.void, fixed, given))
    assign(builder, (there, args[1]))


def _at(context: Any, builder: Any, kind: Any, records: Any, i: Any) -> Any:
    """Record i of records; kind: their type."""
    record = _struct(context, builder, SizedRecord(kind.shape))
    record.memory = builder.gep(records.memory, [builder.mul(i, records.apart)], inbounds=True)
    record.places = records.places
    return record._getvalue()


@intrinsic
def _record_at(typingctx: Any, records: Any, i: Any) -> Any:
    """records[i]; i is not negative."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _at(context, builder, records, _struct(context, builder, records, args[0]), args[1])

    return SizedRecord(records.shape)(records, types.intp), codegen


@intrinsic
def _some_of(typingctx: Any, records: Any, first: Any, count: Any) -> Any:
    """records[first : first + count]."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        some = _struct(context, builder, records, args[0])
        some.memory = builder.gep(some.memory, [builder.mul(args[1], some.apart)], inbounds=True)
        some.count = args[2]
        return some._getvalue()

    return records(records, types.intp, types.intp), codegen


@intrinsic
def _count(typingctx: Any, records: Any) -> Any:
    """How many records there are."""

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
    """iter(records): at the first."""
    iterator = _struct(context, builder, sig.return_type)
    iterator.next = cgutils.alloca_once_value(builder, context.get_constant(types.intp, 0))
    iterator.records = args[0]
    return impl_ret_borrowed(context, builder, sig.return_type, iterator._getvalue())


@lower_builtin("iternext", SizedRecordsIterator)
@iternext_impl(RefType.BORROWED)
def _next(context: Any, builder: Any, sig: Any, args: Any, result: Any) -> None:
    """The next record, unless the last one was given before."""
    (kind,) = sig.args
    iterator, of = _struct(context, builder, kind, args[0]), SizedRecords(kind.shape)
    records = _struct(context, builder, of, iterator.records)
    i = builder.load(iterator.next)
    valid = builder.icmp_signed("<", i, records.count)
    result.set_valid(valid)
    with builder.if_then(valid):
        result.yield_(_at(context, builder, of, records, i))
        builder.store(builder.add(i, WORD(1), flags=["nsw"]), iterator.next)


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
    builder, python = c.builder, c.pyapi
    ask = functools.partial(_places_of, kind.shape.digest)
    asked = held_value(builder, python.pyobj, lambda: python.unserialize(python.serialize_object(ask)))
    address, failed = number_from_python(builder, python, asked, argument)
    return builder.inttoptr(address, WORD.as_pointer()), failed


@unbox(SizedRecord)
def _unbox_record(kind: Any, given: Any, c: Any) -> NativeValue:
    """A record from Python: its memory, which stays Python's, and its places."""
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
    """A row of records from Python, whose caller keeps it for as long as the call lasts."""
    records = _struct(c.context, c.builder, kind)
    builder = c.builder
    bytes_of = types.Array(types.uint8, 1, "A")
    array = make_array(bytes_of)(c.context, builder)
    there = builder.bitcast(array._getpointer(), c.pyapi.voidptr)
    code = c.pyapi.numba_array_adaptor(given, there)
    records.memory = array.data
    (count,), (apart,) = (cgutils.unpack_tuple(builder, of, 1) for of in (array.shape, array.strides))
    records.count, records.apart = count, apart
    records.places, failed = _ask(c, kind, given)
    return NativeValue(
        records._getvalue(),
        is_error=builder.or_(cgutils.is_not_null(builder, code), failed),
    )


def array_type(dtype: Any, dimensions: int) -> Any:
    """The type of a C-ordered array; of records that have a size, theirs."""
    return kind_of(dtype, dimensions) or types.Array(numba.from_dtype(dtype), dimensions, "C")
