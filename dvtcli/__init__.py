"""dvtcli: a PDO configurator for CANopen devices, and its API for Python programs.

    with dvtcli.connect(interface="socketcan", channel="can0") as bus:
        bus.node(1, eds="drive.eds").map("tpdo1", "statusword", "606C", cob_id=0x201, sync=1)

The names in `__all__` are stable, all others may change. A name is imported on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dvtcli.version import __version__

if TYPE_CHECKING:
    from dvtcli import errors, results
    from dvtcli.operations.api.checks import add_eds, check_eds, convert, eds_library, profile, profiles
    from dvtcli.operations.api.network_calls import report
    from dvtcli.operations.api.python_bus import Bus, connect, simulate
    from dvtcli.operations.api.python_lss import Lss
    from dvtcli.operations.api.python_node import Node

__all__ = [
    "Bus",
    "Lss",
    "Node",
    "__version__",
    "add_eds",
    "check_eds",
    "connect",
    "convert",
    "eds_library",
    "errors",
    "profile",
    "profiles",
    "report",
    "results",
    "simulate",
]

_FROM = {
    "Bus": "operations.api.python_bus",
    "Lss": "operations.api.python_lss",
    "add_eds": "operations.api.checks",
    "check_eds": "operations.api.checks",
    "connect": "operations.api.python_bus",
    "convert": "operations.api.checks",
    "eds_library": "operations.api.checks",
    "profile": "operations.api.checks",
    "profiles": "operations.api.checks",
    "report": "operations.api.network_calls",
    "simulate": "operations.api.python_bus",
    "Node": "operations.api.python_node",
}


if not TYPE_CHECKING:  # for a type checker a name that is not there is a mistake

    def __getattr__(name: str) -> Any:
        if name in _FROM:
            return getattr(import_module(f"dvtcli.{_FROM[name]}"), name)
        if name in __all__:
            return import_module(f"dvtcli.{name}")
        raise AttributeError(f"dvtcli has no {name}")


def __dir__() -> list[str]:
    return __all__
