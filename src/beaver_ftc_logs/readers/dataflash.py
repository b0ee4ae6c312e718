"""Messages of a dataflash log one by one, and of each only the numbers that are asked for.

pymavlink by itself makes an index of all messages, reads a log for the time of day, and converts every field.
Here it reads the formats of the messages, and finds the next message where a log is damaged. A log's file is
mapped into memory; the pages that were read are released, so that memory does not grow with the log.
"""

import mmap
import struct
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from pymavlink.DFReader import FORMAT_TO_STRUCT, DFFormat, DFReader_binary, DFReader_text, null_term

_RELEASE_BYTES = 8_000_000
"""Bytes of a log that are read until their pages are released."""
_HEADER, _HEADER_BYTES, _TYPE_OF_FORMATS = b"\xa3\x95", 3, 0x80

PARAMETER_MESSAGE, PARAMETER_FIELDS = "PARM", ("Name", "Value")
PARAMETER_NAME = PARAMETER_FIELDS[0]
"""Message of a parameter: read whatever is asked for, its name as text."""

Numbers = dict[str, Any]
FieldsOfFormat = Callable[[Any], list[str]]


def read_messages(
    path: Path, fields_to_read: Callable[[str, list[str]], list[str]]
) -> Iterator[tuple[str, list[str], Numbers]]:
    """Of each message in a log: its type, its numeric fields, and the numbers of those that are read.

    fields_to_read: gives these fields, by the type of a message and all its numeric fields.
    """
    as_text = path.suffix.lower() == ".log"

    @cache
    def numeric_fields_of(fmt: Any) -> list[str]:
        return _numeric_fields(fmt, as_text)

    @cache
    def fields_of_format(fmt: Any) -> list[str]:
        if _is_format_of_parameter(fmt):
            return list(PARAMETER_FIELDS)
        return fields_to_read(fmt.name, numeric_fields_of(fmt))

    log = (_TextLog if as_text else _BinaryLog)(str(path))
    try:
        for fmt, numbers in log.messages_with_numbers(fields_of_format):
            yield fmt.name, numeric_fields_of(fmt), numbers
    finally:
        log.data_map.close()
        log.filehandle.close()


def _is_format_of_parameter(fmt: Any) -> bool:
    if fmt.name != PARAMETER_MESSAGE or not set(PARAMETER_FIELDS) <= set(fmt.colhash):
        return False
    indices = [fmt.colhash[name] for name in PARAMETER_FIELDS]
    types = fmt.msg_types
    return max(indices) < len(types) and types[indices[0]] is str and types[indices[1]] in (int, float)


def _numeric_fields(fmt: Any, as_text: bool) -> list[str]:
    """The fields that hold numbers, in their order; in text a flight mode (M) is a word."""
    kinds = enumerate(zip(fmt.msg_types, fmt.msg_fmts, strict=True))
    numbers = {i for i, (kind, code) in kinds if kind in (int, float) and not (as_text and code == "M")}
    return [field for field, index in fmt.colhash.items() if index in numbers]


class _MappedLog:
    """What is common to logs as text and as bytes: pymavlink's index and clock are left out, and the pages
    behind the place of reading are released."""

    data_map: mmap.mmap
    data_len: int
    offset: int
    recv_msg: Callable[[], Any]
    _released_offset = 0

    def init_clock(self) -> None:
        """No time of day is wanted, for which all of a log without GPS would be read."""

    def messages_with_numbers(self, fields_of: FieldsOfFormat) -> Iterator[tuple[Any, Numbers]]:
        """Of each message its format, and the numbers of the fields of that format."""
        while (message := self.recv_msg()) is not None:
            yield message.fmt, _numbers_of_message(message, fields_of)
            self._release_before(self.offset)

    def _release_before(self, offset: int) -> None:
        """From time to time, and where the system can."""
        if abs(offset - self._released_offset) >= _RELEASE_BYTES:
            self._released_offset = offset
            if hasattr(mmap, "MADV_DONTNEED"):
                self.data_map.madvise(mmap.MADV_DONTNEED)


def _numbers_of_message(message: Any, fields_of: FieldsOfFormat) -> Numbers:
    return {field: message.__getattr__(field) for field in fields_of(message.fmt)}


class _TextLog(_MappedLog, DFReader_text):
    def init_arrays(self, progress_callback: Any = None) -> None:
        """Read the formats alone, wherever they are: a message may stand before its own."""
        line = self.offset
        while line >= 0:
            self.offset = line
            self._parse_next()
            line = self._find_line_of_format(line)
        self.offset = 0

    def _find_line_of_format(self, begin: int) -> int:
        """Where the next line with a format begins, -1 if there is none."""
        begin_of_line = b"\nFMT,"
        for block in range(begin, self.data_len, _RELEASE_BYTES):
            end = block + _RELEASE_BYTES + len(begin_of_line) - 1
            found = self.data_map.find(begin_of_line, block, end)
            if found >= 0:
                return found + 1
            self._release_before(end)
        return -1


class _BinaryLog(_MappedLog, DFReader_binary):
    def init_arrays(self, progress_callback: Any = None) -> None:
        """Read the formats alone, wherever they are: a message may stand before its own."""
        offset = 0
        while offset + _HEADER_BYTES <= self.data_len:
            fmt = self._format_at(offset)
            end = offset + (fmt.len if fmt else 1)
            if fmt and fmt.type == _TYPE_OF_FORMATS and end <= self.data_len:
                self._read_format(self.data_map[offset + _HEADER_BYTES : end])
            offset = end
            self._release_before(offset)
        self.offset = 0

    def _read_format(self, body: bytes) -> None:
        kind, length, name, codes, columns = struct.unpack(self.formats[_TYPE_OF_FORMATS].msg_struct, body)
        if length < _HEADER_BYTES:
            raise ValueError(f"a message {null_term(name)} would have {length} bytes")
        self.formats[kind] = DFFormat(kind, null_term(name), length, null_term(codes), null_term(columns))

    init_arrays_fast = init_arrays

    def _format_at(self, offset: int) -> Any:
        """The format of the message that begins here, None if none does."""
        head = self.data_map[offset : offset + _HEADER_BYTES]
        return self.formats.get(head[2]) if head[:2] == _HEADER and len(head) == _HEADER_BYTES else None

    def messages_with_numbers(self, fields_of: FieldsOfFormat) -> Iterator[tuple[Any, Numbers]]:
        """The same; pymavlink reads what is damaged, and the formats, which it keeps."""
        layouts = cache(lambda fmt: _Layout(fmt, fields_of))
        while True:
            fmt = self._format_at(self.offset)
            layout = None if fmt is None else layouts(fmt)
            if layout and layout.is_plain and self.offset + fmt.len <= self.data_len:
                yield fmt, layout.read_numbers(self.data_map, self.offset)
                self.offset += fmt.len
            elif (message := self.recv_msg()) is not None:
                yield message.fmt, _numbers_of_message(message, fields_of)
            else:
                return
            self._release_before(self.offset)


class _Layout:
    """Where some numbers of a message are, by its format.

    is_plain: whether the message is as long as its fields, and no format itself.
    """

    def __init__(self, fmt: Any, fields_of: FieldsOfFormat) -> None:
        fields = {fmt.colhash[field]: field for field in fields_of(fmt)}
        codes = [FORMAT_TO_STRUCT[code][0] for code in fmt.msg_fmts]
        skipped = [f"{struct.calcsize(f'<{code}')}x" for code in codes]
        parts = [code if i in fields else skipped[i] for i, code in enumerate(codes)]
        self._struct = struct.Struct(f"<{_HEADER_BYTES}x{''.join(parts)}")
        self._fields = [fields[index] for index in sorted(fields)]
        factors = [
            (i, factor) for i, factor in enumerate(fmt.msg_mults) if factor is not None and i in fields
        ]
        self._divisors = {fields[i]: 1.0 / factor for i, factor in factors}
        self.is_plain = self._struct.size == fmt.len and fmt.name != "FMT"

    def read_numbers(self, data: Any, offset: int) -> Numbers:
        numbers = dict(zip(self._fields, self._struct.unpack_from(data, offset), strict=True))
        if isinstance(name := numbers.get(PARAMETER_NAME), bytes):
            numbers[PARAMETER_NAME] = null_term(name.decode("ascii", "replace"))
        for field, divisor in self._divisors.items():
            numbers[field] /= divisor
        return numbers
