"""Long calls of the kernel outside runs, which Ctrl-C ends although the kernel does not look."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")

# Time between two checks for an interrupt [s]; a result is there at once.
CHECK_SECONDS = 0.1


def interruptible(function: Callable[..., Result], *arguments: Any) -> Result:
    """Call a function that frees Python's lock on a thread, and wait for it; an interrupt leaves
    the thread at work."""
    if threading.current_thread() is not threading.main_thread():
        return function(*arguments)
    results: list[Result] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            results.append(function(*arguments))
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=work, daemon=True)
    try:
        thread.start()
    except RuntimeError:
        # There is no memory for a thread.
        return function(*arguments)
    while thread.is_alive():
        thread.join(CHECK_SECONDS)
    if errors:
        raise errors[0]
    return results[0]
