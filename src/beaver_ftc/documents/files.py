"""Reading a small text file that a third party names: a regular file, of bounded size, UTF-8."""

import hashlib
import os
import stat
from pathlib import Path


class UnreadableError(Exception):
    """The file cannot be used as text; the message says why and what is allowed, the line where: 0 if it is
    the file as a whole."""

    def __init__(self, reason: str, line: int = 0) -> None:
        super().__init__(reason)
        self.line = line


class AbsentFileError(UnreadableError):
    """There is no such file."""


def read_text(path: Path | str, max_bytes: int) -> str:
    """The whole of a regular UTF-8 file.

    Raises UnreadableError; never blocks on a pipe, never reads past max_bytes.
    """
    data = read_bytes(path, max_bytes)
    text, nul, _ = data.partition(b"\0")
    if nul:
        raise UnreadableError("is a binary file, allowed: UTF-8 text", 1 + text.count(b"\n"))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        says = f"byte 0x{data[error.start]:02x} is not UTF-8, allowed: UTF-8 text"
        raise UnreadableError(says, 1 + data[: error.start].count(b"\n")) from None


def read_bytes(path: Path | str, max_bytes: int) -> bytes:
    """The same, of any bytes. It can grow while it is read, and a virtual file says that its size is 0."""
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        with open(path, "rb", opener=lambda name, _: os.open(name, flags)) as file:
            _check_kind_and_size(os.fstat(file.fileno()), max_bytes)
            data = file.read(max_bytes + 1)
    except FileNotFoundError:
        raise AbsentFileError("no such file, allowed: the path of a text file") from None
    except IsADirectoryError:
        raise UnreadableError("is a folder, allowed: a text file") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise UnreadableError(f"cannot be read ({reason}), allowed: a readable text file") from None
    if len(data) > max_bytes:
        raise UnreadableError(f"is too large, allowed: at most {max_bytes / 1e6:g} MB")
    return data


def _check_kind_and_size(status: os.stat_result, max_bytes: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise UnreadableError("is a pipe or a device, allowed: a regular text file")
    if status.st_size > max_bytes:
        size = f"{status.st_size / 1e6:.3g} MB"
        raise UnreadableError(f"is too large ({size}), allowed: at most {max_bytes / 1e6:g} MB")


def digest_of_files(*files: Path) -> str:
    """A name for these files of the package as they are now."""
    digest = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()[:16]
