"""Which files this process opens: counted, since a time would depend on the machine."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_listeners: list[list[str]] = []


def _heard(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _listeners and isinstance(arguments[0], str | os.PathLike):
        for heard in _listeners:
            heard.append(os.fspath(arguments[0]))


@contextmanager
def opened_files(below: Path) -> Iterator[list[str]]:
    """The files below a folder that are opened in the block, by their names, each as often as it is opened."""
    if not _listeners and not hasattr(sys, "_dvtcli_tests_hear_opens"):
        sys.addaudithook(_heard)  # stays for good: nothing takes one away
        sys._dvtcli_tests_hear_opens = True  # type: ignore[attr-defined]
    heard: list[str] = []
    found: list[str] = []
    _listeners.append(heard)
    try:
        yield found
    finally:
        _listeners.remove(heard)
        for one in heard:
            path = Path.cwd() / one
            if below in path.parents and path.is_file():
                found.append(path.name)
