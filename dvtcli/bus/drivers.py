"""`python -m dvtcli.bus.drivers [INTERFACE...]`: ask python-can's drivers for their adapters, as JSON.

A process of its own, ended by who started it (`discover`) where a driver hangs. Opens no bus. Interfaces whose
detection reaches other machines, or invents channels, are only asked by name.
"""

from __future__ import annotations

import json
import os
import sys

import can
from can.interfaces import BACKENDS

#: networks, made-up channels, what `discover` finds by itself, and a driver that loads a library from this folder
NOT_ASKED = frozenset({"virtual", "udp_multicast", "socketcand", "socketcan", "serial", "slcan", "robotell", "neousys"})
#: How long all drivers may look, in seconds; shorter than the patience of who started this process.
_LOOK_S = 6.0


def main(interfaces: list[str]) -> None:
    """Print what is found as one line, and leave without waiting for drivers that hang."""
    asked = interfaces or sorted(set(BACKENDS) - NOT_ASKED)
    found = [channel for name in asked for channel in _detected(name)]
    sys.stdout.write("\n" + json.dumps(found) + "\n")
    sys.stdout.flush()
    os._exit(0)


def _detected(interface: str) -> list[dict[str, str]]:
    """The channels that one driver finds; none where it is missing or broken."""
    try:
        configurations = can.detect_available_configs(interface, timeout=_LOOK_S / 3)
    except Exception:  # noqa: BLE001 - whatever a driver raises means that it finds nothing
        return []
    return [
        {
            "interface": str(configuration["interface"]),
            "channel": str(configuration.get("channel", "0")),
            "about": str(
                dict(configuration).get("device_name") or dict(configuration).get("vector_channel_config") or ""
            )[:40],
        }
        for configuration in configurations
    ]


if __name__ == "__main__":
    main(sys.argv[1:])
