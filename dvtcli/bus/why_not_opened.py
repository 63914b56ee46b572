"""Why a bus did not open, in plain words, and what to do. Opens nothing."""

from __future__ import annotations

import errno
import sys
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches

import can

from dvtcli.bus.maker_drivers import is_missing, what_to_install, why_missing
from dvtcli.bus.python_can_settings import bus_name
from dvtcli.bus.transports import transports
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable

#: what python-can's drivers raise where a driver, a setting or a device is missing
OPEN_FAILURES = (
    can.CanError,
    OSError,
    ValueError,
    TypeError,
    KeyError,
    AttributeError,
    NameError,
    ImportError,
    NotImplementedError,
    RuntimeError,
)
_DRIVER_PACKAGES = {
    "slcan": "python-can[serial]",
    "serial": "python-can[serial]",
    "robotell": "python-can[serial]",
    "seeedstudio": "python-can[seeedstudio]",
    "gs_usb": "python-can[gs-usb]",
    "canalystii": "python-can[canalystii]",
    "cantact": "python-can[cantact]",
    "neovi": "python-can[neovi]",
    "udp_multicast": "python-can[multicast]",
    "pcan": "python-can[pcan]",
}
_NO_CHANNEL = Hint(
    Action.CHECK_SETUP, why="is the adapter plugged in, and the channel's name right? {} lists what is there"
)
_NO_PERMISSION = {
    "linux": "no permission: sudo usermod -aG dialout $USER, then log in again (`ls -l` shows the port's group)",
    "win32": "another program has it open, or this user may not use it",
}.get(sys.platform, "no permission: `ls -l` shows whose it is")
_ERRNO_HINTS: dict[int, Hint | str] = {
    errno.ENODEV: _NO_CHANNEL,
    errno.ENXIO: _NO_CHANNEL,
    errno.ENOENT: _NO_CHANNEL,
    errno.EACCES: _NO_PERMISSION,
    errno.EPERM: _NO_PERMISSION,
    errno.EBUSY: "another program has opened it",
    errno.EAFNOSUPPORT: "this system's kernel has no SocketCAN (sudo modprobe can_raw)",
    errno.ECONNREFUSED: Hint(Action.SERVE, why="nothing listens there: start the server first ({})"),
    errno.ETIMEDOUT: "nothing answers there: is the host's name and port right?",
}
#: what an adapter that is not plugged in, a port that is taken and a server that is not there say
_PASSING = frozenset(
    {errno.ENODEV, errno.ENXIO, errno.ENOENT, errno.EBUSY, errno.EIO, errno.ECONNREFUSED, errno.ECONNRESET}
    | {errno.ETIMEDOUT, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN}
)


def unavailable(config: Mapping[str, object], error: Exception) -> BusUnavailable:
    """What to raise where *config* did not open since python-can or a driver raised *error*."""
    if config.get("interface") is None:
        return BusUnavailable(
            "no CAN interface is configured",
            hint=Hint(Action.GIVE_INTERFACE, why="give {}")
            + Hint(Action.GIVE_CHANNEL, why=" and {}")
            + Hint(Action.GIVE_SIMULATED, {"what": "generic"}, ", or {} for a simulated node"),
        )
    why = str(error) or type(error).__name__
    if isinstance(error, NameError) and config["interface"] in can.VALID_INTERFACES:
        why = why_missing(str(config["interface"]))
    unavailable = BusUnavailable(f"cannot open {bus_name(config)}", why=why, hint=_hint(config, error))
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    unavailable.may_come = number in _PASSING or (isinstance(error, can.CanError) and not is_missing(error))
    return unavailable


def _hint(config: Mapping[str, object], error: Exception) -> Hint | str:
    interface, channel = str(config["interface"]), config.get("channel")
    others = transports()
    if interface not in can.VALID_INTERFACES and interface not in others:
        known = [*can.VALID_INTERFACES, *others]
        near = get_close_matches(interface, known, n=3)
        meant = f"did you mean {near[0]}? " if near else ""
        return f"{meant}known interfaces: {', '.join(sorted(known))}"
    if interface == "socketcan" and {"host", "port"} & config.keys():
        return Hint(
            Action.GIVE_INTERFACE, {"interface": "socketcand"},
            "socketcan is a link of this computer; a server at a host and port is {}",
        )  # fmt: skip
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    if number in _ERRNO_HINTS:
        return _ERRNO_HINTS[number]
    if interface in others and interface not in can.VALID_INTERFACES:
        return f"{interface} comes with a package of its own, whose documentation says what its channel is"
    if isinstance(error, ImportError | can.CanInterfaceNotImplementedError):
        package = _DRIVER_PACKAGES.get(interface)
        if package:
            return f"its driver is missing: pip install '{package}'"
    if is_missing(error) and (install := what_to_install(interface)) is not None:
        return install
    return _setting_hint(interface, channel, error)


def _setting_hint(interface: str, channel: object, error: Exception) -> Hint | str:
    if interface == "socketcand":
        return (
            Hint(Action.GIVE_INTERFACE, {"interface": "socketcand"}, "for example {}")
            + Hint(Action.GIVE_CHANNEL, {"channel": "127.0.0.1:29536"}, " {}, for can0 of that server")
            + Hint(Action.GIVE_CHANNEL, {"channel": "can1"}, "for another one {}")
            + Hint(Action.GIVE_SETTING, {"setting": "host=127.0.0.1"}, " {}")
            + Hint(Action.GIVE_SETTING, {"setting": "port=29536"}, " {}")
        )
    if channel is None:
        return Hint(Action.GIVE_CHANNEL, why="which channel? give {}")
    if isinstance(error, TypeError):
        return Hint(
            Action.GIVE_SETTING, why="a setting is missing or unknown: {}, see python-can's page of this interface"
        )
    return "is the maker's driver installed?" + replace(_NO_CHANNEL, why=f" {_NO_CHANNEL.why}")


def _errno_of(error: BaseException | None) -> int | None:
    """The operating system's number of *error* or of what caused it."""
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return error.errno
        error = error.__cause__ or error.__context__
    return None
