"""`python -m dvtcli.bus.drivers [INTERFACE...]`: ask python-can's drivers for their adapters, as JSON.

A separate process that `discover` can end if a driver hangs. Opens no bus. Interfaces whose
detection reaches other machines, or invents channels, are only asked by name.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from threading import Thread
from time import monotonic

import can
from can.interfaces import BACKENDS

from dvtcli.bus.carrier import Carrier
from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.errors import BusUnavailable

#: library to install for each interface, besides python-can
_LIBRARIES = {
    "pcan": "PEAK's PCAN-Basic",
    "kvaser": "Kvaser's CANlib",
    "ixxat": "HMS's VCI driver (Windows)",
    "vector": "Vector's XL Driver Library (Windows)",
    "nican": "NI-CAN (Windows)",
    "nixnet": "NI-XNET (Windows)",
    "etas": "ETAS' BOA (Windows)",
    "usb2can": "8devices' USB2CAN driver and pywin32 (Windows)",
    "iscan": "Thorsis' isCAN driver (Windows)",
    "neousys": "Neousys' WDT_DIO library",
    "gs_usb": "libusb (Debian: libusb-1.0-0)",
}
#: interfaces that Linux's own kernel also drives, so that nothing need be installed
_KERNEL_KNOWS = frozenset({"pcan", "kvaser", "gs_usb", "usb2can"})
_MISSING = (
    "library not found",
    "could not be loaded",
    "could not load",
    "driver missing",
    "only supported on",
    "no backend",
)
_PCAN_USUAL = 500_000


def is_missing(error: Exception) -> bool:
    """Whether *error* of opening means a missing library, not a missing adapter."""
    # python-can could not import its module, or calls functions of a library that it could not load
    if isinstance(error, NameError | ImportError | AttributeError | can.CanInterfaceNotImplementedError):
        return True
    return any(words in str(error).lower() for words in _MISSING)


def what_to_install(interface: str) -> Hint | None:
    """Advice if the library of *interface* is missing; None if unknown."""
    library = _LIBRARIES.get(interface)
    if library is None:
        return None
    install = as_hint(f"install {library}")
    if sys.platform != "linux" or interface not in _KERNEL_KNOWS:
        return install
    kernels = Hint(Action.GIVE_INTERFACE, {"interface": "socketcan"}, "or let Linux drive the adapter: {}")
    return install + kernels + Hint(Action.GIVE_CHANNEL, {"channel": "can0"}, " {}")


def why_missing(interface: str) -> str:
    """Text for a missing library, in place of the driver's function names."""
    return f"{_LIBRARIES.get(interface, 'its library')} is not installed"


def check_bit_rate(config: Mapping[str, object], bit_rate: int | None) -> None:
    """Raise BusUnavailable if PCAN lacks *bit_rate* (bit/s): python-can would silently use 500,000."""
    from can.interfaces.pcan.basic import PCAN_BITRATES

    if bit_rate is not None and bit_rate not in PCAN_BITRATES and not ({"timing", "fd", "f_clock"} & set(config)):
        known = ", ".join(map(str, sorted(PCAN_BITRATES)))
        raise BusUnavailable(
            f"cannot open pcan:{config.get('channel')}",
            why=f"it cannot run at {bit_rate} bit/s",
            hint=Hint(Action.GIVE_BIT_RATE, why=f"{{}}: {known}"),
        )


class PcanCarrier(Carrier):
    """An adapter of PEAK; *asked* is the requested bit rate (bit/s), None for none."""

    def __init__(self, asked: int | None) -> None:
        self.bit_rate = asked or _PCAN_USUAL
        self._news = [] if asked else [f"no bit rate was given: pcan runs at {_PCAN_USUAL} bit/s"]

    def news(self) -> list[str]:
        """A missing bit rate."""
        news, self._news = self._news, []
        return news


#: networks, invented channels, interfaces found by `discover` itself, and a driver that loads a local library
NOT_ASKED = frozenset({"virtual", "udp_multicast", "socketcand", "socketcan", "serial", "slcan", "robotell", "neousys"})
#: Time for all drivers together, in seconds; shorter than the parent process's patience.
_LOOK_S = 15.0
#: python-can's own time-out per driver, which hides what did not answer: longer than ours
_FOREVER_S = 600.0


def main(interfaces: list[str], look_s: float = _LOOK_S) -> None:
    """Print the channels found and the drivers that did not answer as one line; exit without waiting for them."""
    asked = interfaces or sorted(set(BACKENDS) - NOT_ASKED)
    channels: dict[str, list[dict[str, str]]] = {}
    threads = [Thread(target=_detect, args=(name, channels), daemon=True) for name in asked]
    deadline = monotonic() + look_s
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, deadline - monotonic()))
    answered = dict(channels)
    found = [channel for name in asked for channel in answered.get(name, ())]
    answer = {"found": found, "unanswered": [name for name in asked if name not in answered]}
    sys.stdout.write("\n" + json.dumps(answer) + "\n")
    sys.stdout.flush()
    os._exit(0)


def _detect(interface: str, channels: dict[str, list[dict[str, str]]]) -> None:
    """Put the channels found by a driver into *channels*; none if it is missing or broken."""
    try:
        configurations = can.detect_available_configs(interface, timeout=_FOREVER_S)
    except Exception:  # noqa: BLE001 - whatever a driver raises means that it finds nothing
        configurations = []
    channels[interface] = [
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
