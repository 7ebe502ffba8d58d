"""Files of compiled libraries, each with a hash of its content beside it.

A damaged library ends the process that loads it, so it is loaded only if its content is what was
built and is whole.
"""

from __future__ import annotations

import ctypes
import hashlib
import struct
from pathlib import Path

from deltaopt.files.atomic_write import to_disk
from deltaopt.files.regular_file import content_of

_LARGEST = 100
"""Size of a library, MB: the largest have one or two."""
_ELF = b"\x7fELF\x02\x01"
"""Beginning of files of Linux for processors of 64 bits, little end first."""
_SECTIONS, _SECTIONS_AT = "<QI5H", 40
"""Of such a file: where its sections are listed, and of the list the size and number of entries."""


def hash_file(library: Path) -> Path:
    """Where the hash of a library's content is kept."""
    return library.with_suffix(".sha256")


def intact(library: Path) -> bool:
    """Whether a library is there, has the content that was built, and can be loaded.

    Not where its folder may hold no programs, or where another machine built it.
    """
    try:
        content = content_of(library, _LARGEST)
        if content_of(hash_file(library), _LARGEST) != hashlib.sha256(content).hexdigest().encode():
            return False
        if content.startswith(_ELF) and len(content) < _end_of_sections(content):
            return False  # what lies beyond the end of a file ends the process that reads it
        ctypes.CDLL(str(library))
    except (OSError, struct.error):
        return False
    return True


def _end_of_sections(content: bytes) -> int:
    """Where an ELF file's table of sections ends, which compilers put last."""
    begin, *_, size, number = struct.unpack_from(_SECTIONS, content, _SECTIONS_AT)
    return int(begin + size * number)


def put(built: Path, library: Path) -> None:
    """Move a library that was built, with its hash, to where it is kept.

    Both are on the disk before they bear their names: a name must never outlast what it names.
    """
    digest = hash_file(built)
    digest.write_text(hashlib.sha256(built.read_bytes()).hexdigest())
    for file, name in ((built, library), (digest, hash_file(library))):
        to_disk(file)
        file.replace(name)
