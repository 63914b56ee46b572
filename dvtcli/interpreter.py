"""The command line to start a Python process with code of ours."""

import sys

#: How a frozen program (scripts/freeze.py) is told to be a Python: -c and -m are options of dvtcli there.
AS_PYTHON = "--as-python"


def python_words() -> list[str]:
    """This Python, to be followed by its options and `-m MODULE` or `-c CODE`; a frozen program is its own Python."""
    return [sys.executable, AS_PYTHON] if getattr(sys, "frozen", False) else [sys.executable]
