"""What commands answer: values that `view` turns into text, and that say their own JSON document.

Field names of documents are stable (docs/reference/json.md). A name is looked for in the files of this room, and its
file imported, when it is first used: a command needs two or three of them.
"""

from __future__ import annotations

import os
import re
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dvtcli.operations.results.bit_rates import *  # noqa: F403
    from dvtcli.operations.results.bus_events import *  # noqa: F403
    from dvtcli.operations.results.changes import *  # noqa: F403
    from dvtcli.operations.results.checked_files import *  # noqa: F403
    from dvtcli.operations.results.checked_networks import *  # noqa: F403
    from dvtcli.operations.results.comparisons import *  # noqa: F403
    from dvtcli.operations.results.device_profiles import *  # noqa: F403
    from dvtcli.operations.results.diagnosis import *  # noqa: F403
    from dvtcli.operations.results.documents import *  # noqa: F403
    from dvtcli.operations.results.dvt import *  # noqa: F403
    from dvtcli.operations.results.explained import *  # noqa: F403
    from dvtcli.operations.results.failures import *  # noqa: F403
    from dvtcli.operations.results.files import *  # noqa: F403
    from dvtcli.operations.results.frames import *  # noqa: F403
    from dvtcli.operations.results.habit_listing import *  # noqa: F403
    from dvtcli.operations.results.learnt import *  # noqa: F403
    from dvtcli.operations.results.library_files import *  # noqa: F403
    from dvtcli.operations.results.loads import *  # noqa: F403
    from dvtcli.operations.results.logged_in import *  # noqa: F403
    from dvtcli.operations.results.lss_nodes import *  # noqa: F403
    from dvtcli.operations.results.networks import *  # noqa: F403
    from dvtcli.operations.results.node_errors import *  # noqa: F403
    from dvtcli.operations.results.nodes import *  # noqa: F403
    from dvtcli.operations.results.pdos import *  # noqa: F403
    from dvtcli.operations.results.programs import *  # noqa: F403
    from dvtcli.operations.results.records import *  # noqa: F403
    from dvtcli.operations.results.sent import *  # noqa: F403
    from dvtcli.operations.results.stores import *  # noqa: F403
    from dvtcli.operations.results.sync_producers import *  # noqa: F403
    from dvtcli.operations.results.values import *  # noqa: F403
    from dvtcli.operations.results.vpdos import *  # noqa: F403
    from dvtcli.operations.results.watched_values import *  # noqa: F403
    from dvtcli.operations.results.whole_devices import *  # noqa: F403

_ROOM = os.path.dirname(__file__)  # noqa: PTH120


if not TYPE_CHECKING:  # for a type checker a name that is not there is a mistake

    def __getattr__(name: str) -> Any:
        defines = re.compile(rf"^(?:class|def) {re.escape(name)}\b|^{re.escape(name)} = ".encode(), re.M)
        for file in sorted(os.listdir(_ROOM)):  # noqa: PTH208 - these lines are run by every command
            if file.endswith(".py") and not file.startswith("_"):
                with open(os.path.join(_ROOM, file), "rb") as text:  # noqa: PTH118, PTH123
                    is_here = defines.search(text.read())
                if is_here:
                    found = globals()[name] = getattr(import_module(f"{__name__}.{file.removesuffix('.py')}"), name)
                    return found
        raise AttributeError(f"dvtcli.operations.results has no {name}")
