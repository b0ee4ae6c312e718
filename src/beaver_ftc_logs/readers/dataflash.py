"""Messages of a dataflash log by name: where each one is, and its numbers field by field.

A binary log has messages of fixed length behind a header, a log as text (.log) has a line a message.
pymavlink knows what the codes of a format mean. A log's file is mapped into memory; the numbers of a field
are gathered when they are asked for.
"""

import struct
from array import array
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.DFReader import FORMAT_TO_STRUCT, DFFormat, null_term

from beaver_ftc_logs.recording import Floats

_HEADER = b"\xa3\x95"
_HEADER_BYTES = 3  # these two and the kind of the message
_FORMAT_KIND = 0x80  # of the messages that describe a format: its kind, length, name, codes and columns
_FORMAT_LAYOUT = "<BB4s16s64s"
_FORMAT_BYTES = 89  # header and layout


@dataclass(frozen=True)
class Messages:
    """All messages of one format. begins: where each is in the data of the log."""

    data: mmap
    format: Any
    begins: array
    is_text: bool

    @cached_property
    def fields(self) -> dict[str, type]:
        """The fields that hold numbers, in their order, int or float; in text a flight mode (M) is a word."""
        types = dict(enumerate(self.format.msg_types))
        codes = self.format.msg_fmts
        words = {i for i, code in enumerate(codes) if self.is_text and code == "M"}
        places = {field: i for field, i in self.format.colhash.items() if i not in words}
        return {field: types[i] for field, i in places.items() if types.get(i) in (int, float)}

    def numbers(self, field: str) -> Floats:
        """The numbers of a field, (n,). To divide by 1e7 is more exact than to multiply by 1e-7."""
        values = np.array(self.cells(field), dtype=float)
        factor = self.format.msg_mults[self.format.colhash[field]]
        return values if factor is None or self.is_text else values / (1.0 / factor)

    def texts(self, field: str) -> list[str]:
        """The words of a field."""
        if self.is_text:
            return list(self.cells(field))
        return [cell.partition(b"\0")[0].decode("ascii", "replace") for cell in self.cells(field)]

    def cells(self, field: str) -> Any:
        """The field in each message as it is written: numbers or bytes, texts in a log as text."""
        i = self.format.colhash[field]
        if self.is_text:
            return [_line(self.data, at).split(",")[i + 1].strip() for at in self.begins]
        codes = [FORMAT_TO_STRUCT[code][0] for code in self.format.msg_fmts]
        size = struct.calcsize(f"<{codes[i]}")
        offset = struct.calcsize(f"<{''.join(codes[:i])}")
        windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(self.data, np.uint8), size)
        kind = f"S{size}" if codes[i].endswith("s") else f"<{codes[i]}"
        return windows[np.array(self.begins) + (_HEADER_BYTES + offset)].view(kind)[:, 0]


def read_messages(path: Path) -> dict[str, Messages]:
    """The messages of a log by name, in the order in which they first come."""
    with path.open("rb") as file:
        data = mmap(file.fileno(), 0, access=ACCESS_READ)
    is_text = path.suffix.lower() == ".log"
    found = _text_messages(data) if is_text else _binary_messages(data)
    return {fmt.name: Messages(data, fmt, begins, is_text) for fmt, begins in found if begins}


def _binary_messages(data: mmap) -> Iterator[tuple[Any, array]]:
    """Formats with the places of their messages. The formats are read first, wherever they are: a message may
    stand before its own."""
    lengths = {_FORMAT_KIND: _FORMAT_BYTES}
    formats = {}
    for kind, at in _binary_begins(data, lengths):
        if kind == _FORMAT_KIND:
            described, length, *texts = struct.unpack_from(_FORMAT_LAYOUT, data, at + _HEADER_BYTES)
            name, codes, columns = map(null_term, texts)
            if length < _HEADER_BYTES:
                raise ValueError(f"a message {name} would have {length} bytes")
            formats[described] = DFFormat(described, name, length, codes, columns)
            lengths[described] = length
    begins: defaultdict[int, array] = defaultdict(lambda: array("q"))
    for kind, at in _binary_begins(data, lengths):
        begins[kind].append(at)
    for kind, places in begins.items():
        fmt = formats.get(kind)
        if fmt is not None and struct.calcsize(fmt.msg_struct) + _HEADER_BYTES == fmt.len:
            yield fmt, places


def _binary_begins(data: mmap, lengths: dict[int, int]) -> Iterator[tuple[int, int]]:
    """Kind and place of each whole message; bytes that begin none are passed over."""
    at = 0
    while at + _HEADER_BYTES <= len(data):
        head = data[at : at + _HEADER_BYTES]
        length = lengths.get(head[2], 0) if head[:2] == _HEADER else 0
        if length and at + length <= len(data):
            yield head[2], at
        at += length or 1


def _text_messages(data: mmap) -> Iterator[tuple[Any, array]]:
    """The same of a log as text: lines with fewer cells than their format are left out."""
    begins: defaultdict[str, array] = defaultdict(lambda: array("q"))
    formats = {}
    at = data.find(b"FMT,")
    while 0 <= at < len(data):
        line = _line(data, at)
        kind = line.partition(",")[0]
        begins[kind].append(at)
        if kind == "FMT":
            _, number, length, name, codes, columns = map(str.strip, line.split(",", 5))
            plain = ",".join(map(str.strip, columns.split(",")))
            formats[name] = DFFormat(int(number), name, int(length), codes, plain)
        end = data.find(b"\n", at)
        at = end + 1 if end >= 0 else len(data)
    for kind, places in begins.items():
        if fmt := formats.get(kind):
            whole = (at for at in places if _line(data, at).count(",") >= len(fmt.format))
            yield fmt, array("q", whole)


def _line(data: mmap, at: int) -> str:
    """The line of a log as text that begins at a place."""
    end = data.find(b"\n", at)
    return data[at : end if end >= 0 else len(data)].rstrip().decode()
