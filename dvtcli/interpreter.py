"""The Python that runs dvtcli: how to start another process of it, and how a missing package gets into it."""

import os
import sys

#: How a frozen program (scripts/freeze.py) is told to be a Python: -c and -m are options of dvtcli there.
AS_PYTHON = "--as-python"


def is_frozen() -> bool:
    """Whether dvtcli runs from a program that `scripts/freeze.py` made, with a Python of its own."""
    return bool(getattr(sys, "frozen", False))


def python_words() -> list[str]:
    """This Python, to be followed by its options and `-m MODULE` or `-c CODE`; a frozen program is its own Python."""
    return [sys.executable, AS_PYTHON] if is_frozen() else [sys.executable]


def changed_variables() -> dict[str, str]:
    """The user's values of what a frozen program changes for itself: for programs of the user that it starts."""
    name = "LD_LIBRARY_PATH"
    return {name: os.environ.get(f"{name}_ORIG", "")} if is_frozen() and name in os.environ else {}


def how_to_install(requirement: str) -> str:
    """How to get the missing package *requirement*: pip's line; a frozen program cannot be given any."""
    if is_frozen():
        return f"this program was made without {requirement}: install dvtcli with pip to have it"
    return f"pip install '{requirement}'"
