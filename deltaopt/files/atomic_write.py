"""Atomic write: a file appears completely or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``, which is renamed to ``path`` at the end.

    If an error is raised in between, the temporary file is removed and ``path`` stays as it was.
    Raises OSError, which names ``path``, if it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
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


def to_disk(file: Path) -> None:
    """Wait until a file's content is on the disk: a name must never outlast what it names."""
    with file.open("rb+") as opened:
        os.fsync(opened.fileno())


def default_mode(most: int) -> int:
    """The permissions of a new file or directory, of at most these, as the user wants them."""
    mask = os.umask(0)
    os.umask(mask)
    return most & ~mask
