"""What is loaded when it is first used, by its name in a table that the package's door gives.

``import deltaopt`` loads nothing that a program may not need. And a plan offers what rooms to its
right do, such as ``plan.save("out")``, without knowing them: the door, which knows all rooms, says
where that is.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

PLACES: dict[str, str] = {}
"""The module of each name; ``deltaopt/__init__.py`` fills it before any other module is read."""


def loaded(name: str) -> Any:
    """What has a name in the table. Raises KeyError if nothing has."""
    return getattr(import_module(PLACES[name]), name)
