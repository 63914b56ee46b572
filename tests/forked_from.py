"""Read once, by the process that every forked dvtcli comes from: all code that a dvtcli may need."""

from __future__ import annotations

import pkgutil
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this tree, wherever another one is installed
sys.dont_write_bytecode = False  # what is compiled here need not be again for the next one

import dvtcli  # noqa: E402

for _module in pkgutil.walk_packages(dvtcli.__path__, "dvtcli."):
    with suppress(ImportError):  # an extra that is not installed is missed by what needs it
        import_module(_module.name)
