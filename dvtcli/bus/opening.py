"""Opening a python-can bus, or one that another package brings. Does not know what the bus is used for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import can

from dvtcli.bus.bit_rate_setter import BitRateSetter
from dvtcli.bus.carrier import Carrier
from dvtcli.bus.kernel_carrier import KernelCarrier, check_link
from dvtcli.bus.kernel_links import kernel_link
from dvtcli.bus.maker_drivers import PcanCarrier, check_bit_rate
from dvtcli.bus.python_can import CanBus
from dvtcli.bus.python_can_settings import bit_rate_of, bus_name, completed, given_settings
from dvtcli.bus.sdo.sdo_link import DEFAULT_RETRIES, DEFAULT_TIMEOUT_S
from dvtcli.bus.server_carrier import ServerCarrier, probe
from dvtcli.bus.slcan_carrier import SlcanCarrier
from dvtcli.bus.transports import transports
from dvtcli.bus.why_not_opened import OPEN_FAILURES, unavailable
from dvtcli.domain.ports import CanopenBus

#: interfaces that hand our own frames back only with receive_own_messages
_NO_ECHO_UNASKED = frozenset({"socketcan", "virtual"})
#: what python-can says where the first frames came in one read with a server's last answer, which it wants alone, and
#: how often a server is asked again then
_FRAMES_TOO_SOON = "got: '< ok ><"
_TRIES = 8


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
    config = given = given_settings(interface, channel, bitrate, extra or {})
    try:
        config = completed(given)
        _look_first(config)
        bus = _open(config)
    except OPEN_FAILURES as error:
        raise unavailable(config, error) from error
    carrier = _carrier(config, bus)
    opened = CanBus(
        bus,
        bus_name(config),
        timeout_s=timeout_s,
        retries=retries,
        bitrate=carrier.bit_rate or bit_rate_of(config),
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
    config = given = given_settings(interface, channel, bit_rate, extra)
    try:
        config = completed(given)
        setter = BitRateSetter(config, _open)
        link = kernel_link(str(config.get("channel"))) if config["interface"] == "socketcan" else None
        if link is not None and link.up and link.listen_only:
            return CanBus(_open(config), bus_name(config), bitrate=link.bit_rate, setter=setter)
        setter.require(bit_rate, listen_only=listen_only)
        bus = setter.reopened(bit_rate, listen_only=listen_only)
    except OPEN_FAILURES as error:
        raise unavailable(config, error) from error
    return CanBus(bus, bus_name(config), bitrate=bit_rate, carrier=_carrier(config, bus), setter=setter)


def _look_first(config: Mapping[str, object]) -> None:
    """What can be seen before it is opened to be of no use; one of OPEN_FAILURES with a better reason."""
    if config["interface"] == "socketcand":
        probe(config)
    if config["interface"] == "socketcan":
        check_link(config.get("channel"))
    if config["interface"] == "pcan":
        check_bit_rate(config, bit_rate_of(config))


def _open(config: Mapping[str, object]) -> can.BusABC:
    options: dict[str, Any] = {**config, "ignore_config": True}
    for _ in range(_TRIES - 1):
        try:
            return can.Bus(**options)
        except can.CanError as error:
            if _FRAMES_TOO_SOON not in str(error):
                raise
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
        raise unavailable({"interface": interface, "channel": channel}, error) from error
    return opened


def _carrier(config: Mapping[str, object], bus: can.BusABC) -> Carrier:
    """What can be said of *bus* beyond its frames."""
    if config["interface"] == "socketcan":
        return KernelCarrier(bus, str(config["channel"]), bit_rate_of(config))
    if config["interface"] == "pcan":
        return PcanCarrier(bit_rate_of(config))
    if config["interface"] == "slcan":
        return SlcanCarrier(str(config["channel"]), bit_rate_of(config))
    return ServerCarrier(bus) if config["interface"] == "socketcand" else Carrier()
