"""Reading what a user names: a regular file of a size that can be dealt with, and nothing else."""

from __future__ import annotations

import errno
import stat
from pathlib import Path

_MEGABYTE = 1_000_000


def content_of(file: Path, megabytes: int) -> bytes:
    """The content of a regular file of at most so many megabytes.

    Opening a pipe would wait for somebody who writes to it, and a device has no end. Raises OSError
    whose ``strerror`` says of the file what is wrong, such as "is larger than 1 MB".
    """
    try:
        mode = file.stat().st_mode
        if stat.S_ISREG(mode) or stat.S_ISDIR(mode):  # opening a directory is an OSError
            with file.open("rb") as opened:
                content = opened.read(megabytes * _MEGABYTE + 1)  # it may grow meanwhile
            problem = "" if len(content) <= megabytes * _MEGABYTE else f"larger than {megabytes} MB"
        else:
            problem = "not a regular file"
    except OSError as error:
        text = f"cannot be read ({error.strerror})"
        raise OSError(error.errno, text, str(file)) from None
    except ValueError:  # of a NUL
        problem = "no name of a file"
    if problem:
        raise OSError(errno.EINVAL, f"is {problem}", str(file))
    return content
