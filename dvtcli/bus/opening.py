"""Opening a python-can bus, and saying in plain words why it did not open.

Does not know what the bus is used for.
"""

from __future__ import annotations

import errno
import logging
import sys
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import can
from can import util

from dvtcli.bus.bit_rate_setter import BitRateSetter
from dvtcli.bus.carrier import Carrier
from dvtcli.bus.kernel_carrier import KernelCarrier, check_link
from dvtcli.bus.kernel_links import kernel_link
from dvtcli.bus.maker_drivers import PcanCarrier, check_bit_rate, is_missing, what_to_install, why_missing
from dvtcli.bus.python_can import CanBus
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.server_carrier import ServerCarrier, probe
from dvtcli.bus.slcan_carrier import SlcanCarrier
from dvtcli.bus.transports import transports
from dvtcli.domain.ports import CanopenBus
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
#: interfaces that hand our own frames back only with receive_own_messages
_NO_ECHO_UNASKED = frozenset({"socketcan", "virtual"})
_NO_CHANNEL = "is the adapter plugged in, and the channel's name right? `dvtcli doctor` lists what is there"
_NO_PERMISSION = {
    "linux": "no permission: sudo usermod -aG dialout $USER, then log in again (`ls -l` shows the port's group)",
    "win32": "another program has it open, or this user may not use it",
}.get(sys.platform, "no permission: `ls -l` shows whose it is")
_ERRNO_HINTS = {
    errno.ENODEV: _NO_CHANNEL,
    errno.ENXIO: _NO_CHANNEL,
    errno.ENOENT: _NO_CHANNEL,
    errno.EACCES: _NO_PERMISSION,
    errno.EPERM: _NO_PERMISSION,
    errno.EBUSY: "another program has opened it",
    errno.EAFNOSUPPORT: "this system's kernel has no SocketCAN (sudo modprobe can_raw)",
    errno.ECONNREFUSED: "nothing listens there: start the server first (`dvtcli sim NODE --listen HOST:PORT`)",
    errno.ETIMEDOUT: "nothing answers there: is the host's name and port right?",
}
#: what an adapter that is not plugged in, a port that is taken and a server that is not there say
_PASSING = frozenset(
    {errno.ENODEV, errno.ENXIO, errno.ENOENT, errno.EBUSY, errno.EIO, errno.ECONNREFUSED, errno.ECONNRESET}
    | {errno.ETIMEDOUT, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN}
)

# python-can logs what it also raises; without a handler, logging would print that over our own message.
for _logger in ("can", "seeedbus"):
    logging.getLogger(_logger).addHandler(logging.NullHandler())


def open_bus(
    interface: str | None = None,
    channel: str | None = None,
    bitrate: int | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanBus:
    """Open a CAN interface; raises BusUnavailable with the reason and a hint.

    *interface*, *channel*, *bitrate* (bit/s) and *extra* have python-can's names and meaning; what is None
    comes from python-can's own configuration. *timeout_s* is the SDO time-out, *retries* (0..) how often a
    read's first request is repeated after it.
    """
    given = {key: value for key, value in _given(interface, channel, bitrate, extra or {}).items() if value is not None}
    config = given
    try:
        config = _completed(given)
        if config["interface"] == "socketcand":
            probe(config)
        if config["interface"] == "socketcan":
            check_link(config.get("channel"))
        if config["interface"] == "pcan":
            check_bit_rate(config, _bitrate(config))
        bus = _open(config)
    except OPEN_FAILURES as error:
        raise _unavailable(config, error) from error
    carrier = _carrier(config, bus)
    bit_rate = carrier.bit_rate or _bitrate(config)
    opened = CanBus(
        bus,
        _name(config),
        timeout_s=timeout_s,
        retries=retries,
        bitrate=bit_rate,
        carrier=carrier,
        setter=BitRateSetter(config, _open),
    )
    if config["interface"] in _NO_ECHO_UNASKED and not config.get("receive_own_messages"):
        opened.echoes.rule_out()
    return opened


def open_listening(
    interface: str | None, channel: str | None, bit_rate: int, extra: Mapping[str, object], *, listen_only: bool
) -> CanBus:
    """Open a CAN interface to listen at *bit_rate* (bit/s), and at others after that (`set_bit_rate`).

    With *listen_only* without a word; SafetyRefusal where that is not known of it, or its bit rate cannot be set from
    here. A link of the system's is listened to as it is where that says nothing by its own. BusUnavailable.
    """
    given = {key: value for key, value in _given(interface, channel, bit_rate, extra).items() if value is not None}
    config = given
    try:
        config = _completed(given)
        setter = BitRateSetter(config, _open)
        link = kernel_link(str(config.get("channel"))) if config["interface"] == "socketcan" else None
        if link is not None and link.up and link.listen_only:
            return CanBus(_open(config), _name(config), bitrate=link.bit_rate, setter=setter)
        setter.require(bit_rate, listen_only=listen_only)
        bus = setter.reopened(bit_rate, listen_only=listen_only)
    except OPEN_FAILURES as error:
        raise _unavailable(config, error) from error
    return CanBus(bus, _name(config), bitrate=bit_rate, carrier=_carrier(config, bus), setter=setter)


def _open(config: Mapping[str, object]) -> can.BusABC:
    options: dict[str, Any] = {**config, "ignore_config": True}
    return can.Bus(**options)


def open_transport(
    interface: str | None = None,
    channel: str | None = None,
    bitrate: int | None = None,
    extra: Mapping[str, object] | None = None,
    *,
    timeout_s: float = DEFAULT_TIMEOUT_S,
    retries: int = DEFAULT_RETRIES,
) -> CanopenBus:
    """As `open_bus`, also by a way to a bus that is no python-can interface, and which another package brings.

    It is found by an entry point of the group `dvtcli.bus` with the name *interface*: a function with the parameters
    of this one but the first.
    """
    found = None if interface is None or interface in can.VALID_INTERFACES else transports().get(interface)
    if found is None:
        return open_bus(interface, channel, bitrate, extra, timeout_s=timeout_s, retries=retries)
    try:
        opened: CanopenBus = found.load()(channel, bitrate, extra or {}, timeout_s=timeout_s, retries=retries)
    except OPEN_FAILURES as error:
        raise _unavailable({"interface": interface, "channel": channel}, error) from error
    return opened


def _given(
    interface: str | None, channel: str | None, bitrate: int | None, extra: Mapping[str, object]
) -> dict[str, object]:
    typed = {key: util.cast_from_string(value) if isinstance(value, str) else value for key, value in extra.items()}
    return {**typed, "interface": interface, "channel": channel, "bitrate": bitrate}


def _completed(given: dict[str, object]) -> dict[str, object]:
    """*given* and what python-can's files and environment add, unless that is for another interface."""
    asked = given.get("interface")
    configured = {**util.load_file_config(), **util.load_environment_config(), **can.rc}
    if asked is not None and configured.get("interface", asked) != asked:
        if asked not in can.VALID_INTERFACES:
            raise can.CanInterfaceNotImplementedError(f'Unknown interface type "{asked}"')
        return dict(given)
    config: dict[str, object] = dict(util.load_config(config=dict(given)))
    if "receive_own_messages" not in given:
        config.pop("receive_own_messages", None)  # a file's setting for other programs: our own frames are no answers
    return config


def is_configured() -> bool:
    """Whether python-can's own files or environment name an interface."""
    return library_settings().get("interface") is not None


def library_settings() -> dict[str, tuple[object, str]]:
    """What python-can's files and environment say, by key, each with where it stands."""
    files = ", ".join(path for path in util.CONFIG_FILES if Path(path).expanduser().is_file())
    found: dict[str, tuple[object, str]] = {key: (value, files) for key, value in util.load_file_config().items()}
    found |= {key: (value, f"CAN_{key.upper()}") for key, value in util.load_environment_config().items()}
    return found | {key: (value, "can.rc") for key, value in can.rc.items()}


def _carrier(config: Mapping[str, object], bus: can.BusABC) -> Carrier:
    """What can be said of *bus* beyond its frames."""
    if config["interface"] == "socketcan":
        return KernelCarrier(bus, str(config["channel"]), _bitrate(config))
    if config["interface"] == "pcan":
        return PcanCarrier(_bitrate(config))
    if config["interface"] == "slcan":
        return SlcanCarrier(str(config["channel"]), _bitrate(config))
    return ServerCarrier(bus) if config["interface"] == "socketcand" else Carrier()


def _name(config: Mapping[str, object]) -> str:
    where = config.get("channel")
    if "host" in config:
        where = f"{config['host']}:{config.get('port')}"
    return f"{config['interface']}:{where}" if where is not None else str(config["interface"])


def _bitrate(config: Mapping[str, object]) -> int | None:
    """The bit rate in bit/s that was asked for, None where none was."""
    try:
        rate = int(str(config.get("bitrate")))
    except ValueError:
        return None
    return rate if rate > 0 else None


def _unavailable(config: Mapping[str, object], error: Exception) -> BusUnavailable:
    if config.get("interface") is None:
        return BusUnavailable(
            "no CAN interface is configured",
            hint="give -i/--interface and -c/--channel, or --sim generic for a simulated node",
        )
    why = str(error) or type(error).__name__
    if isinstance(error, NameError) and config["interface"] in can.VALID_INTERFACES:
        why = why_missing(str(config["interface"]))
    unavailable = BusUnavailable(f"cannot open {_name(config)}", why=why, hint=_hint(config, error))
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    unavailable.may_come = number in _PASSING or (isinstance(error, can.CanError) and not is_missing(error))
    return unavailable


def _hint(config: Mapping[str, object], error: Exception) -> str:
    interface, channel = str(config["interface"]), config.get("channel")
    others = transports()
    if interface not in can.VALID_INTERFACES and interface not in others:
        known = [*can.VALID_INTERFACES, *others]
        near = get_close_matches(interface, known, n=3)
        meant = f"did you mean {near[0]}? " if near else ""
        return f"{meant}known interfaces: {', '.join(sorted(known))}"
    if interface == "socketcan" and {"host", "port"} & config.keys():
        return "socketcan is a link of this computer; a server at a host and port is -i socketcand"
    number = errno.ETIMEDOUT if isinstance(error, TimeoutError) else _errno_of(error)
    if number in _ERRNO_HINTS:
        return _ERRNO_HINTS[number]
    if isinstance(error, ImportError | can.CanInterfaceNotImplementedError):
        package = _DRIVER_PACKAGES.get(interface)
        if package:
            return f"its driver is missing: pip install '{package}'"
    if is_missing(error) and (install := what_to_install(interface)) is not None:
        return install
    return _setting_hint(interface, channel, error)


def _setting_hint(interface: str, channel: object, error: Exception) -> str:
    if interface == "socketcand":
        return "for example -i socketcand -c can0 --bus-kwargs host=127.0.0.1 --bus-kwargs port=29536"
    if channel is None:
        return "which channel? give -c/--channel"
    if isinstance(error, TypeError):
        return "a setting is missing or unknown: --bus-kwargs key=value, see python-can's page of this interface"
    return f"is the maker's driver installed? {_NO_CHANNEL}"


def _errno_of(error: BaseException | None) -> int | None:
    """The operating system's number of *error* or of what caused it."""
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None:
            return error.errno
        error = error.__cause__ or error.__context__
    return None
