"""Reopen an interface at another bit rate if its python-can driver can, else explain how to set it by hand."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files

import can

from dvtcli.bus.kernel_links import kernel_link
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, SafetyRefusal


@cache
def silent_settings() -> Mapping[str, Mapping[str, object]]:
    """Settings for listen-only mode by interface name, if supported."""
    told = tomllib.loads((files("dvtcli.bus") / "listen_only.toml").read_text("utf-8"))
    states = {state.name: state for state in can.BusState}
    return {
        name: {key: states[value] if key == "state" else value for key, value in settings.items()}
        for name, settings in told.items()
    }


def is_silent(bus: can.BusABC, settings: Mapping[str, object]) -> bool:
    """Whether *bus*, opened with *settings*, is in listen-only mode, as far as its driver can tell."""
    return settings.get("state") in (None, bus.state)


#: interfaces that take a bit rate at opening, besides those with listen-only mode
_SETTABLE = {
    "canalystii", "etas", "gs_usb", "iscan", "ixxat", "neousys", "neovi", "nican", "robotell", "usb2can",
}  # fmt: skip
#: settings with which a bit rate alone does not define the bit timing
_TIMINGS = ("timing", "btr", "fd", "f_clock", "data_bitrate", "fd_bitrate")

#: Opens the interface by these settings.
Open = Callable[[Mapping[str, object]], can.BusABC]


class BitRateSetter:
    """Bit rate changes of the interface in *config*, opened by *opens*."""

    def __init__(self, config: Mapping[str, object], opens: Open) -> None:
        self._config, self._open = config, opens
        self._interface, self._channel = str(config["interface"]), config.get("channel")

    def require(self, bit_rate: int, *, listen_only: bool) -> None:
        """Raise SafetyRefusal with instructions if *bit_rate* or *listen_only* is not possible."""
        where = f"{self._interface}:{self._channel}"
        if self._interface == "socketcan":
            raise SafetyRefusal(
                f"the bit rate of {where} is set by the system, not by dvtcli",
                why=None
                if listen_only
                else "it can neither be changed together with the nodes nor restored if a node is lost",
                hint=_link_lines(str(self._channel), bit_rate, listen_only=listen_only),
            )
        if self._interface not in _SETTABLE | silent_settings().keys():
            raise SafetyRefusal(
                f"the bit rate of {where} cannot be set from here", why="it is set by its server",
                hint="set it there; or open a CAN adapter of this machine",
            )  # fmt: skip
        timing = next((key for key in _TIMINGS if self._config.get(key)), None)
        if timing is not None:
            raise SafetyRefusal(
                f"{where} was opened with {timing}, which is more than a bit rate",
                hint=Hint(Action.GIVE_BIT_RATE, why="open it with {}"),
            )
        if listen_only and self._interface not in silent_settings():
            raise SafetyRefusal(
                f"{self._interface} is not known to listen without a word",
                why="at a wrong bit rate it would destroy the frames of others",
                hint=f"these are: {', '.join(silent_settings())}"
                + Hint(Action.FORCE, why="on a bus without traffic: {}"),
            )

    def reopened(self, bit_rate: int, *, listen_only: bool) -> can.BusABC:
        """The interface, open at *bit_rate* (bit/s); it must be closed before. Raises the driver's errors."""
        silence = silent_settings()[self._interface] if listen_only else {}
        bus = self._open({**self._config, "bitrate": bit_rate, **silence})
        if not is_silent(bus, silence):
            bus.shutdown()
            raise BusUnavailable(f"{self._interface}:{self._channel} does not confirm listen-only mode")
        return bus


def _link_lines(name: str, bit_rate: int, *, listen_only: bool) -> Hint | str:
    """Commands that set the Linux CAN link *name* to *bit_rate* (bit/s)."""
    link = kernel_link(name)
    if link is not None and not link.wired:
        return f"{name} is virtual and has no bit rate"
    how = f"type can bitrate {bit_rate} listen-only {'on' if listen_only else 'off'}"
    lines = f"sudo ip link set {name} down; sudo ip link set {name} up {how}"
    if not listen_only:
        return f"where the nodes run at it already: {lines}"
    return lines + Hint(Action.LISTEN_BIT_RATE, why="then {} again")
