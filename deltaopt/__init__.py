"""Verified minimum-time motions of Delta robots, and the closed-chain dynamics behind them."""

from deltaopt.interrupts.imports import end_at_once_if_command

end_at_once_if_command()

from importlib import import_module

from deltaopt.later import PLACES, loaded


def _public() -> dict[str, str]:
    """The module of each public name, from the imports in ``__init__.pyi``, which type checkers
    read: ``from MODULE import A as A, B as B``."""
    with open(__file__.removesuffix("c") + "i", encoding="utf-8") as stub:
        _, *imports = stub.read().split("\nfrom ")
    return {
        name.partition(",")[0].strip(" \n)"): module
        for module, names in (each.split(" import ") for each in imports)
        for name in names.split(" as ")[1:]
    }


_PUBLIC = _public()
__all__ = sorted(name for name, module in _PUBLIC.items() if module != "deltaopt.research")
PLACES |= _PUBLIC | {  # what a plan offers that is the work of other rooms
    "save_plan": "deltaopt.report.folders",
    "frame": "deltaopt.output.plan_files",
    "plot_limit": "deltaopt.plots.limits",
    "sensitivity": "deltaopt.sensitivity.sensitivity",
}

import_module("deltaopt.verify")  # now, for Python then names the room in this one's namespace
del globals()["verify"]  # in which the function is to be found


def __getattr__(name: str) -> object:
    """A public name, or a room such as ``deltaopt.errors``: found without this from then on."""
    if name in _PUBLIC:
        globals()[name] = found = loaded(name)
        return found
    room = f"{__name__}.{name}"
    try:
        if not name.startswith("_"):
            return import_module(room)
    except ModuleNotFoundError as error:
        if error.name != room:
            raise
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
