"""The CAN interfaces of this machine: SocketCAN links, adapters that a driver finds, serial ports.

Imports no CAN library: drivers are asked in a process of their own (`drivers`), so that one that hangs, crashes or
prints cannot hurt. Opens nothing, and asks no other machine. Does not know nodes, nor who wants to know.
"""

from __future__ import annotations

import glob
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

#: How long drivers may take to look for their adapters, in seconds.
PATIENCE_S = 8.0
#: Linux's number for the hardware type CAN, and its flag of a link that is up
_ARPHRD_CAN, _IFF_UP = 280, 1
_SERIAL_PORTS = ("ttyUSB*", "ttyACM*", "cu.usbmodem*", "cu.usbserial*")


@dataclass(frozen=True, slots=True)
class Found:
    """An interface with python-can's names for it; *about* says what it is, *problem* what to do before it opens."""

    interface: str
    channel: str
    about: str = ""
    problem: str | None = None


def find_interfaces(patience_s: float = PATIENCE_S) -> list[Found]:
    """Everything that may be a CAN interface, surest first; drivers get *patience_s* seconds."""
    return [*links(), *adapters(patience_s=patience_s), *serial_ports()]


def links(folder: Path = Path("/sys/class/net"), bit_rates: Mapping[str, int] | None = None) -> list[Found]:
    """SocketCAN links under *folder*, up or down; *bit_rates* (bit/s) default to what `ip` says."""
    names = [path.name for path in sorted(folder.glob("*")) if _number(path / "type") == _ARPHRD_CAN]
    if names and bit_rates is None:
        bit_rates = _bit_rates()
    return [_link(name, _number(folder / name / "flags"), (bit_rates or {}).get(name)) for name in names]


def _link(name: str, flags: int, bit_rate: int | None) -> Found:
    rate = "" if not bit_rate else f", {bit_rate / 1000:g} kbit/s"
    if flags & _IFF_UP:
        return Found("socketcan", name, f"up{rate}")
    how = "" if name.startswith("vcan") else " type can bitrate 500000"
    return Found("socketcan", name, f"down{rate}", f"it is down: sudo ip link set {name} up{how}")


def _number(path: Path) -> int:
    """A number in a file of /sys, decimal or 0x; 0 where there is none."""
    try:
        return int(path.read_text("ascii").strip(), 0)
    except (OSError, ValueError):
        return 0


def _bit_rates() -> dict[str, int]:
    """Bit rates of SocketCAN links, by name, as far as the tool `ip` is there to say them."""
    tool = shutil.which("ip")
    output = _output([tool, "-json", "-details", "link", "show", "type", "can"], 1.0) if tool else None
    return bit_rates_of(output or "")


def bit_rates_of(text: str) -> dict[str, int]:
    """Bit rates (bit/s) by link, from what `ip -json -details link show` prints."""
    try:
        rows = json.loads(text or "[]")
        timings = {row["ifname"]: row["linkinfo"]["info_data"]["bittiming"] for row in rows if _has_timing(row)}
        return {name: int(timing["bitrate"]) for name, timing in timings.items()}
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}


def _has_timing(row: dict[str, dict[str, dict[str, object]]]) -> bool:
    return "bittiming" in row.get("linkinfo", {}).get("info_data", {})


def adapters(interfaces: Sequence[str] = (), *, patience_s: float = PATIENCE_S) -> list[Found]:
    """What the drivers of *interfaces* (default: all that look for adapters by themselves) find on this machine."""
    command = [sys.executable, "-m", "dvtcli.bus.drivers", *interfaces]
    lines = (_output(command, patience_s) or "").splitlines()
    configurations = json.loads(lines[-1]) if lines else []
    return [Found(one["interface"], one["channel"], one["about"]) for one in configurations]


def _output(command: Sequence[str], patience_s: float) -> str | None:
    """What *command* prints; None where it fails, crashes, or takes longer than *patience_s*."""
    try:
        done = subprocess.run(  # noqa: S603 - our own words
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL,
            timeout=patience_s, encoding="utf-8", errors="replace", check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout if done.returncode == 0 else None


def serial_ports(folder: str = "/dev") -> list[Found]:
    """USB serial ports, which may be slcan adapters."""
    return [_port(path) for path in _ports(folder)]


def _ports(folder: str) -> Iterator[str]:
    for pattern in _SERIAL_PORTS:
        yield from sorted(glob.glob(os.path.join(folder, pattern)))  # noqa: PTH118, PTH207 - paths as texts


def _port(path: str) -> Found:
    allowed = os.access(path, os.R_OK | os.W_OK)
    problem = None if allowed else "no permission: sudo usermod -aG dialout $USER, then log in again"
    return Found("slcan", path, "a serial port: only if an slcan adapter is on it", problem)
