"""Corners of the triangles in an STL file, binary or text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.regular_file import content_of
from deltaopt.files.units import LENGTH, Misread

_HEADER, _COUNT = 80, 4
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LARGEST = 20
"""Largest size of a file, MB: of 400,000 triangles, where bodies here have a hundred at most."""
_EXPECTED = "an STL file, lengths in m"


def corners_in(file: Path) -> Array:
    """The distinct corners in an STL file, (N, 3), in its unit of length.

    Raises SceneError where it cannot be read.
    """
    try:
        content = content_of(file, _LARGEST)
    except OSError as error:
        raise SceneError(file, "", None, _EXPECTED, str(error.strerror)) from None
    body = content[_HEADER + _COUNT :]
    number = int.from_bytes(content[_HEADER : _HEADER + _COUNT], "little")
    if number and len(body) == number * _TRIANGLE.itemsize:
        found = np.frombuffer(body, _TRIANGLE)["corners"].reshape(-1, 3).astype(float)
    else:
        found = _of_text(content.decode("ascii", errors="replace"), file)
    if not len(found) or not np.isfinite(found).all():
        raise SceneError(file, "", None, _EXPECTED, "has no triangles")
    try:
        LENGTH.in_si(float(np.abs(found).max()))
    except Misread as error:
        raise SceneError(
            file, "", None, f"{_EXPECTED}, not mm", f"has a corner that {error}"
        ) from None
    return np.asarray(np.unique(found, axis=0))


def _of_text(text: str, file: Path) -> Array:
    """The numbers of all lines that begin with ``vertex``."""
    try:
        rows = [
            [float(word) for word in words[1:]]
            for words in map(str.split, text.splitlines())
            if words and words[0].lower() == "vertex"
        ]
        return np.array(rows, dtype=float).reshape(-1, 3)
    except ValueError:
        raise SceneError(file, "", None, _EXPECTED, "is not an STL file") from None
