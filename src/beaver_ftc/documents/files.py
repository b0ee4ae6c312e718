"""Reading a small text file that a stranger names: a regular file, of bounded size, UTF-8."""

import os
import stat
from pathlib import Path


class UnreadableError(Exception):
    """The file cannot be used as text; the message says why and what is allowed, the line where."""

    def __init__(self, reason: str, line: int = 1) -> None:
        super().__init__(reason)
        self.line = line


def read_text(path: Path, max_bytes: int) -> str:
    """The whole of a regular UTF-8 file.

    Raises UnreadableError; never blocks on a pipe, never reads past max_bytes.
    """
    data = read_bytes(path, max_bytes)
    if b"\0" in data:
        raise UnreadableError(
            "is a binary file, allowed: UTF-8 text", 1 + data[: data.index(b"\0")].count(b"\n")
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = 1 + data[: error.start].count(b"\n")
        raise UnreadableError(
            f"byte 0x{data[error.start]:02x} is not UTF-8, allowed: UTF-8 text", line
        ) from None


def read_bytes(path: Path, max_bytes: int) -> bytes:
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise UnreadableError("no such file, allowed: the path of a file that exists") from None
    except (OSError, ValueError) as error:
        raise UnreadableError(f"cannot be read ({_reason(error)}), allowed: a readable text file") from None
    try:
        _check_kind_and_size(os.fstat(descriptor), max_bytes)
        return _read_to_end(descriptor, max_bytes)
    except OSError as error:
        raise UnreadableError(f"cannot be read ({_reason(error)}), allowed: a readable text file") from None
    finally:
        os.close(descriptor)


def _read_to_end(descriptor: int, max_bytes: int) -> bytes:
    """All there is, which may be more than the file's size said: it can grow, and a virtual file says 0."""
    data = b""
    while chunk := os.read(descriptor, max_bytes + 1 - len(data)):
        data += chunk
        if len(data) > max_bytes:
            raise UnreadableError(f"is too large, allowed: at most {max_bytes / 1e6:g} MB")
    return data


def _check_kind_and_size(status: os.stat_result, max_bytes: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise UnreadableError("is a folder, allowed: a text file")
    if not stat.S_ISREG(status.st_mode):
        raise UnreadableError("is a pipe or a device, allowed: a regular text file")
    if status.st_size > max_bytes:
        raise UnreadableError(
            f"is too large ({status.st_size / 1e6:.3g} MB), allowed: at most {max_bytes / 1e6:g} MB"
        )


def _reason(error: OSError | ValueError) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()
