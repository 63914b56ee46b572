"""Settings of an interface from python-can's own files, the environment, and the user. Opens nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import can
from can import util

from dvtcli.bus import can_message  # noqa: F401 - keeps python-can's log from stderr

_ADDRESS = re.compile(r"(.+):([0-9]{1,5})")
#: interfaces whose frames go to this machine's hardware, or stay in it
_LOCAL = frozenset(
    {
        "canalystii", "cantact", "etas", "gs_usb", "iscan", "ixxat", "kvaser", "neousys", "neovi", "nican", "nixnet",
        "pcan", "robotell", "seeedstudio", "serial", "slcan", "socketcan", "usb2can", "vector", "virtual",
    }
)  # fmt: skip


def given_settings(
    interface: str | None, channel: str | None, bitrate: int | None, extra: Mapping[str, object]
) -> dict[str, object]:
    """The user's settings by python-can's keys, without None; texts of *extra* are converted to values.

    The *channel* of a socketcand server may be its address, `127.0.0.1:29536`, if no host and no port are given.
    """
    typed = {key: util.cast_from_string(value) if isinstance(value, str) else value for key, value in extra.items()}
    address = _ADDRESS.fullmatch(channel or "")
    if interface == "socketcand" and address is not None and not typed.keys() & {"host", "port"}:
        typed |= {"host": address[1].strip("[]"), "port": int(address[2])}
        channel = "can0"  # the default name of a server's bus
    given = {**typed, "interface": interface, "channel": channel, "bitrate": bitrate}
    return {key: value for key, value in given.items() if value is not None}


def with_library_settings(given: dict[str, object]) -> dict[str, object]:
    """*given* with python-can's files and environment, unless these are for another interface."""
    interface = given.get("interface")
    configured = {**util.load_file_config(), **util.load_environment_config(), **can.rc}
    if interface is not None and configured.get("interface", interface) != interface:
        if interface not in can.VALID_INTERFACES:
            raise can.CanInterfaceNotImplementedError(f'Unknown interface type "{interface}"')
        return dict(given)
    config: dict[str, object] = dict(util.load_config(config=dict(given)))
    if "receive_own_messages" not in given:
        config.pop("receive_own_messages", None)  # a file's setting for other programs: echoes are no answers
    return config


def is_configured() -> bool:
    """Whether python-can's own files or environment name an interface."""
    return "interface" in library_settings()


def library_settings() -> dict[str, tuple[object, str]]:
    """Settings of python-can's files and environment, by key, each with its source."""
    files = ", ".join(path for path in util.CONFIG_FILES if Path(path).expanduser().is_file())
    found: dict[str, tuple[object, str]] = {key: (value, files) for key, value in util.load_file_config().items()}
    found |= {key: (value, f"CAN_{key.upper()}") for key, value in util.load_environment_config().items()}
    return found | {key: (value, "can.rc") for key, value in can.rc.items()}


def bus_name(config: Mapping[str, object]) -> str:
    """Name of the bus of *config*: `slcan:/dev/ttyACM0`, `socketcand:127.0.0.1:29536`."""
    where = config.get("channel")
    if "host" in config:
        where = f"{config['host']}:{config.get('port')}"
    return f"{config['interface']}:{where}" if where is not None else str(config["interface"])


def is_network(interface: str | None, channel: str | None, extra: Mapping[str, object]) -> bool:
    """Whether frames may leave this machine, according to the bus settings.

    They stay on a local interface if its channel and *extra* are no address.
    """
    name = interface or library_settings().get("interface", ("", ""))[0]
    addressed = any("://" in str(value) for value in (channel or "", *extra.values()))
    return name not in _LOCAL or addressed


def bit_rate_of(config: Mapping[str, object]) -> int | None:
    """The requested bit rate in bit/s, None for none."""
    try:
        rate = int(str(config.get("bitrate")))
    except ValueError:
        return None
    return rate if rate > 0 else None
