"""The CAN interfaces of this machine: SocketCAN links, adapters found by drivers, serial ports.

Imports no CAN library: drivers run in a separate process (`drivers`), so that hangs, crashes and
output do no harm. Opens nothing, and asks no other machine.
"""

from __future__ import annotations

import glob
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dvtcli.bus.kernel_links import kernel_links
from dvtcli.interpreter import python_words

#: Time for the process that asks the drivers, in seconds; it gives the drivers themselves less (`drivers`).
PATIENCE_S = 40.0
_PERHAPS = "a serial port: only if an slcan adapter is on it"
_SERIAL_PORTS = ("ttyUSB*", "ttyACM*", "cu.usbmodem*", "cu.usbserial*")


@dataclass(frozen=True, slots=True)
class FoundInterface:
    """An interface with python-can's names; *about* describes it, *problem* tells how to make it usable."""

    interface: str
    channel: str
    about: str = ""
    problem: str | None = None


class InterfaceSearch(NamedTuple):
    """Interfaces *found*, surest first, and drivers *unanswered*: whether their adapters exist is unknown."""

    found: list[FoundInterface]
    unanswered: tuple[str, ...] = ()


def find_interfaces() -> InterfaceSearch:
    """All possible CAN interfaces of this machine."""
    found, unanswered = adapters()
    return InterfaceSearch([*links(), *found, *serial_ports()], unanswered)


def links() -> list[FoundInterface]:
    """SocketCAN links, up or down."""
    return [FoundInterface("socketcan", link.name, link.about, link.problem) for link in kernel_links()]


def adapters(interfaces: Sequence[str] = (), *, patience_s: float = PATIENCE_S) -> InterfaceSearch:
    """Adapters on this machine found by the drivers of *interfaces* (default: all with safe detection)."""
    lines = (_output([*python_words(), "-m", "dvtcli.bus.drivers", *interfaces], patience_s) or "").splitlines()
    if not lines:
        return InterfaceSearch([], tuple(interfaces) or ("any driver",))
    answer = json.loads(lines[-1])
    found = [FoundInterface(row["interface"], row["channel"], row["about"]) for row in answer["found"]]
    return InterfaceSearch(found, tuple(answer["unanswered"]))


def drivers_missing(*, patience_s: float = PATIENCE_S) -> dict[str, list[str] | None]:
    """Interface -> what its driver lacks on this system; None if there is no such driver here. Empty if unknown."""
    lines = (_output([*python_words(), "-m", "dvtcli.bus.driver_parts"], patience_s) or "").splitlines()
    found: dict[str, list[str] | None] = json.loads(lines[-1]) if lines else {}
    return found


def _output(command: Sequence[str], patience_s: float) -> str | None:
    """Output of *command*; None if it fails, crashes, or takes longer than *patience_s*."""
    try:
        done = subprocess.run(  # noqa: S603 - our own words
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
            timeout=patience_s, encoding="utf-8", errors="replace", check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None


def serial_ports(folder: str = "/dev") -> list[FoundInterface]:
    """USB serial ports as possible slcan adapters; on Windows all serial ports."""
    if sys.platform == "win32":
        return [FoundInterface("slcan", name, _PERHAPS) for name in _named_ports()]
    return [_port(path) for path in _ports(folder)]


def _named_ports() -> list[str]:
    """Serial ports in the Windows registry, by number."""
    if sys.platform != "win32":
        return []
    import winreg

    names: list[str] = []
    try:
        with winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, r"HARDWARE\DEVICEMAP\SERIALCOMM") as key:
            while True:
                names.append(str(winreg.EnumValue(key, len(names))[1]))
    except OSError:  # after the last port, or without any
        return sorted(names, key=lambda name: (len(name), name))


def _ports(folder: str) -> Iterator[str]:
    for pattern in _SERIAL_PORTS:
        yield from sorted(glob.glob(os.path.join(folder, pattern)))  # noqa: PTH118, PTH207 - paths as texts


def _port(path: str) -> FoundInterface:
    allowed = os.access(path, os.R_OK | os.W_OK)
    cure = "sudo usermod -aG dialout $USER, then log in again" if sys.platform == "linux" else f"ls -l {path}"
    problem = None if allowed else f"no permission: {cure}"
    return FoundInterface("slcan", path, _PERHAPS, problem)
