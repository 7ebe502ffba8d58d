"""Atomic write: a file appears completely or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``, which is renamed to ``path`` at the end.

    If an error is raised in between, the temporary file is removed and ``path`` stays as it was.
    Raises OSError, which names ``path``, if it cannot be written, or must not be replaced.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    require_replaceable(path)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            to_disk(temporary)
            temporary.chmod(default_mode(0o666))
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:  # which names a temporary file, or none, as where a disk is full
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def write_text(file: Path, text: str) -> None:
    """Write a text file, whole or not at all. Raises OSError, which names it."""
    with atomic_write(file) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def require_replaceable(path: Path) -> None:
    """Raise OSError where something has this name that is no file: a link, a pipe or a device is
    somebody's means to an end, which a file in its place would break; or a file that its owner has
    protected from writing."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a directory", str(path))
    if path.is_symlink() or (path.exists() and not path.is_file()):
        kind = "a link" if path.is_symlink() else "not a regular file"
        raise FileExistsError(errno.EEXIST, f"is {kind}, and is not replaced", str(path))
    if path.exists() and not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, "is write-protected, and is not replaced", str(path))


def to_disk(file: Path) -> None:
    """Wait until a file's content is on the disk: a name must never outlast what it names."""
    with file.open("rb+") as opened:
        os.fsync(opened.fileno())


def default_mode(most: int) -> int:
    """The permissions of a new file or directory, of at most these, as the user wants them."""
    mask = os.umask(0)
    os.umask(mask)
    return most & ~mask
