"""Messages of a dataflash log by name: where each one is, and its numbers field by field.

A binary log has messages of fixed length behind a header, a log as text (.log) has a line a message.
pymavlink has the meaning of the codes of a format. The file is mapped into memory; the numbers of a field are
read when a caller requires them.
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
_HEADER_BYTES = 3  # these two bytes and the kind of the message
# A message of this kind describes a format: its kind, length, name, codes and columns.
_FORMAT_KIND = 0x80
_FORMAT_LAYOUT = "<BB4s16s64s"
_FORMAT_BYTES = 89  # length of such a message: header and layout


@dataclass(frozen=True)
class Messages:
    """All messages of one format. begins: position of each in the data of the log, bytes."""

    data: mmap
    format: Any
    begins: array
    is_text: bool

    @cached_property
    def fields(self) -> dict[str, type]:
        """The fields that hold numbers, in their order, with int or float. In a log as text, a flight mode
        (code M) is a word and not a number.
        """
        cells = [*zip(self.format.msg_types, self.format.msg_fmts, strict=False)]
        known = {field: cells[i] for field, i in self.format.colhash.items() if i < len(cells)}
        return {
            field: kind
            for field, (kind, code) in known.items()
            if kind in (int, float) and not (self.is_text and code == "M")
        }

    def numbers(self, field: str) -> Floats:
        """The numbers of a field, (n,). To divide by 1e7 is more exact than to multiply by 1e-7."""
        values = np.array(self.cells(field), dtype=float)
        factor = self.format.msg_mults[self.format.colhash[field]]
        return values if factor is None or self.is_text else values / (1.0 / factor)

    def texts(self, field: str) -> list[str]:
        """The field as text, for each message."""
        if self.is_text:
            return list(self.cells(field))
        return [cell.partition(b"\0")[0].decode("ascii", "replace") for cell in self.cells(field)]

    def cells(self, field: str) -> Any:
        """The field as it is stored, for each message: numbers or bytes in a binary log, texts in a log as
        text."""
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
    """Name -> messages of a log, in the order of the first message of each name."""
    with path.open("rb") as file:
        data = mmap(file.fileno(), 0, access=ACCESS_READ)
    is_text = path.suffix.lower() == ".log"
    formats = _text_messages(data) if is_text else _binary_messages(data)
    return {fmt.name: Messages(data, fmt, begins, is_text) for fmt, begins in formats if begins}


def _binary_messages(data: mmap) -> Iterator[tuple[Any, array]]:
    """Each format with the positions of its messages. A message may precede the message that describes its
    format, so all formats are read first. A format whose codes have another length is left out.
    """
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
    for kind, positions in begins.items():
        fmt = formats.get(kind)
        if fmt is not None and struct.calcsize(fmt.msg_struct) + _HEADER_BYTES == fmt.len:
            yield fmt, positions


def _binary_begins(data: mmap, lengths: dict[int, int]) -> Iterator[tuple[int, int]]:
    """Kind and position of each complete message. Bytes that begin no message are skipped."""
    at = 0
    while at + _HEADER_BYTES <= len(data):
        head = data[at : at + _HEADER_BYTES]
        length = lengths.get(head[2], 0) if head[:2] == _HEADER else 0
        if length and at + length <= len(data):
            yield head[2], at
        at += length or 1


def _text_messages(data: mmap) -> Iterator[tuple[Any, array]]:
    """Each format of a log as text with the positions of its messages. Lines with fewer cells than their
    format are left out.
    """
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
    for kind, positions in begins.items():
        if fmt := formats.get(kind):
            whole = (at for at in positions if _line(data, at).count(",") >= len(fmt.format))
            yield fmt, array("q", whole)


def _line(data: mmap, at: int) -> str:
    """The line of a log as text that begins at a position."""
    end = data.find(b"\n", at)
    return data[at : end if end >= 0 else len(data)].rstrip().decode()
