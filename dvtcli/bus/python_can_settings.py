"""What python-can's own files and environment say of an interface, and what was asked for besides. Opens nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import can
from can import util

from dvtcli.bus import can_message  # noqa: F401 - keeps python-can's log from stderr

_ADDRESS = re.compile(r"(.+):([0-9]{1,5})")
#: interfaces whose frames go to hardware of this machine, or stay in it
_LOCAL = frozenset(
    {
        "canalystii", "cantact", "etas", "gs_usb", "iscan", "ixxat", "kvaser", "neousys", "neovi", "nican", "nixnet",
        "pcan", "robotell", "seeedstudio", "serial", "slcan", "socketcan", "usb2can", "vector", "virtual",
    }
)  # fmt: skip
#: what a server's bus is called, where nobody says it
_SERVED = "can0"


def given_settings(
    interface: str | None, channel: str | None, bitrate: int | None, extra: Mapping[str, object]
) -> dict[str, object]:
    """What was asked for, by python-can's keys, and nothing for what is None; texts of *extra* as what they mean.

    The *channel* of a socketcand server may be its address, `127.0.0.1:29536`, where no host and no port are given.
    """
    typed = {key: util.cast_from_string(value) if isinstance(value, str) else value for key, value in extra.items()}
    address = _ADDRESS.fullmatch(channel or "")
    if interface == "socketcand" and address is not None and not typed.keys() & {"host", "port"}:
        typed |= {"host": address[1].strip("[]"), "port": int(address[2])}
        channel = _SERVED
    asked = {**typed, "interface": interface, "channel": channel, "bitrate": bitrate}
    return {key: value for key, value in asked.items() if value is not None}


def completed(given: dict[str, object]) -> dict[str, object]:
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


def bus_name(config: Mapping[str, object]) -> str:
    """What the bus of *config* is called: `slcan:/dev/ttyACM0`, `socketcand:127.0.0.1:29536`."""
    where = config.get("channel")
    if "host" in config:
        where = f"{config['host']}:{config.get('port')}"
    return f"{config['interface']}:{where}" if where is not None else str(config["interface"])


def is_network(interface: str | None, channel: str | None, extra: Mapping[str, object]) -> bool:
    """Whether the frames of a bus may leave this machine, by the settings as they were asked for.

    They do not where the interface is an adapter's, or of this machine, and its channel and *extra* are no address.
    """
    asked = interface or library_settings().get("interface", ("", ""))[0]
    addressed = any("://" in str(value) for value in (channel or "", *extra.values()))
    return asked not in _LOCAL or addressed


def bit_rate_of(config: Mapping[str, object]) -> int | None:
    """The bit rate in bit/s that was asked for, None where none was."""
    try:
        rate = int(str(config.get("bitrate")))
    except ValueError:
        return None
    return rate if rate > 0 else None
