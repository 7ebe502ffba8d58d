"""Files of compiled libraries, each with a hash of its content beside it.

A damaged library ends the process that loads it, so it is loaded only if its content is what was
built.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path


def hash_file(library: Path) -> Path:
    """Where the hash of a library's content is kept."""
    return library.with_suffix(".sha256")


def intact(library: Path) -> bool:
    """Whether a library is there and has the content that was built."""
    try:
        return hash_file(library).read_text() == hashlib.sha256(library.read_bytes()).hexdigest()
    except (OSError, UnicodeDecodeError):
        return False


def put(built: Path, library: Path) -> None:
    """Move a library that was built, with its hash, to where it is kept.

    Both are on the disk before they bear their names: a name must never outlast what it names.
    """
    digest = hash_file(built)
    digest.write_text(hashlib.sha256(built.read_bytes()).hexdigest())
    for file, name in ((built, library), (digest, hash_file(library))):
        with file.open("rb+") as opened:
            os.fsync(opened.fileno())
        file.replace(name)
