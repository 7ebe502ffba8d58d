"""What a call returns, and how many seconds of the processor it takes."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import TypeVar

from deltaopt.errors import DeltaOptError

Result = TypeVar("Result")


def timed(call: Callable[[], Result]) -> tuple[Result, float]:
    """What a call returns, and its seconds."""
    begin = process_time()
    result = call()
    return result, process_time() - begin


def attempted(call: Callable[[], Result]) -> tuple[Result | None, str, float]:
    """What a call returns, or None and why it raised a DeltaOptError; and its seconds."""
    begin, result, failure = process_time(), None, ""
    try:
        result = call()
    except DeltaOptError as error:
        failure = f"{type(error).__name__}: {error}"
    return result, failure, process_time() - begin
