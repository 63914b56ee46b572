"""Read once, by the process that every forked dvtcli comes from: all code that a dvtcli may need."""

from __future__ import annotations

import gc
import pkgutil
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # this tree, wherever another one is installed
sys.dont_write_bytecode = False  # what is compiled here need not be again for the next one

#: what libraries import in a function
_LATE = (
    "click._textwrap",
    "encodings.idna",
    "encodings.utf_8_sig",
    "can.interfaces.virtual",
    "can.interfaces.socketcand",
)

import dvtcli  # noqa: E402
from dvtcli.files.profiles import passcode_objects  # noqa: E402
from dvtcli.operations.session.simulated_nodes import read_dictionary  # noqa: E402
from dvtcli.simulator.network.family_file import family_eds, family_names, load_family  # noqa: E402

for _name in [*(module.name for module in pkgutil.walk_packages(dvtcli.__path__, "dvtcli.")), *_LATE]:
    with suppress(ImportError):  # an extra that is not installed is missed by what needs it
        import_module(_name)

# What the product keeps of files as long as they are as they were, it has read already.
for _name in family_names():
    load_family(_name)
    for _entry in read_dictionary(family_eds(_name)).entries():
        pass
passcode_objects()
gc.freeze()  # a process that looks for garbage here would copy every page
