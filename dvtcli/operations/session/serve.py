"""Serve simulated nodes to other programs by the options: nodes, addresses, stored values.

The counterpart of `network` at the other end of the bus.
"""

from __future__ import annotations

import ipaddress
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.errors import BusUnavailable, InputFileError, UsageError
from dvtcli.files.sim_state import read_state, write_state
from dvtcli.operations.session.simulated_nodes import (
    Simulated,
    not_simulated,
    simulated_device,
    simulated_faults,
    simulated_nodes,
    simulated_signals,
)
from dvtcli.operations.user.options import Options, node_id

if TYPE_CHECKING:
    from dvtcli.domain.ports import CanopenBus
    from dvtcli.operations.session.open_network import OnBusEvent
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.hub import Hub
    from dvtcli.simulator.network.shared_bus import JoinedBus, Server

#: socketcand's port, by its documentation
DEFAULT_PORT = 29536
LOOPBACK = "127.0.0.1"
_LONGEST_LATENCY_MS = 60_000


@dataclass(frozen=True, slots=True)
class ServeRequest:
    """The request of `sim`.

    *nodes* as for `--sim`; *address* to listen at, None: none; *join*: join the bus of the options; *state* is the
    folder of stored values; *latencies* are response times of SDO servers: node-ID (None: all others) and time (s).
    """

    nodes: tuple[str, ...]
    address: tuple[str, int] | None
    join: bool = False
    state: Path | None = None
    latencies: tuple[tuple[int | None, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Serving:
    """Nodes ready for `server.run()`; *port* is None without listening."""

    server: Server
    nodes: tuple[Simulated, ...]
    port: int | None
    joined: str | None


def address(text: str) -> tuple[str, int]:
    """Read `HOST:PORT`, `[IPv6]:PORT`, `:PORT` or `PORT`; a missing host is 127.0.0.1. UsageError otherwise."""
    match = re.fullmatch(r"(?:(?:\[([0-9A-Fa-f:.]+)\]|([^\s:\[\]]*)):)?(\d{1,5})", text, re.ASCII)
    if match is None or int(match[3]) > 65535:
        raise UsageError(
            "not HOST:PORT", given={"listen": text}, hint="for example 127.0.0.1:29536; port 0 is a free one"
        )
    return match[1] or match[2] or LOOPBACK, int(match[3])


def latency_of(text: str) -> tuple[int | None, float]:
    """Read `[NODE:]MS`, 0…60000 ms; the node-ID, None for every other node, and the time (s). UsageError otherwise."""
    node, colon, time = text.rpartition(":")
    if not re.fullmatch(r"\d{1,5}(\.\d{1,3})?", time, re.ASCII) or float(time) > _LONGEST_LATENCY_MS:
        raise UsageError("not [NODE:]MS", given={"latency": text}, hint="for example 2 or 5:20, up to 60000 ms")
    return (node_id(node) if colon else None), float(time) / 1000


def is_loopback(host: str) -> bool:
    """OnBusEvent whether only programs on this machine reach *host*."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


@contextmanager
def serving(
    options: Options, wanted: ServeRequest, warn: Callable[[str], None], on_bus_event: OnBusEvent = lambda _event: None
) -> Iterator[Serving]:
    """Open everything for *wanted*, and close it at the end; *warn* takes warnings.

    With the option `reconnect` a lost bus is waited for, and *on_bus_event* gets the events. Raises BusUnavailable if
    an address or a bus cannot be opened, UsageError and InputFileError for wrong words and files.
    """
    from dvtcli.simulator.network.shared_bus import Server, Wire
    from dvtcli.simulator.network.station import stations

    nodes = simulated_nodes(wanted.nodes, options.modules)
    for text in not_simulated(nodes):
        warn(text)
    devices = [simulated_device(node) for node in nodes]
    keep = _keeper(wanted.state, nodes, devices, warn)
    nodes = tuple(
        served_node._replace(node_id=device.node_id) for served_node, device in zip(nodes, devices, strict=True)
    )
    _warn_of_doubles(devices, wanted, warn)
    faults = _faults(options, nodes)
    signals, rate = simulated_signals(options.signal, nodes), options.bitrate
    latencies_s = _latencies(wanted.latencies, devices)
    with ExitStack() as stack:
        hub = _hub(wanted.address, warn)
        stack.callback(hub.close)
        joined = _joined(options, hub, on_bus_event) if wanted.join else None
        if joined is not None:
            stack.callback(joined.close)
        server = Server(
            stations(devices, faults, signals, bit_rate=rate, known_rates=() if rate is None else (rate,)),
            hub,
            Wire(None if wanted.join else rate),
            [] if joined is None else [joined],
            latencies_s=latencies_s,
            stored=keep,
            bus_failed=lambda: warn("the bus is dead (a simulated fault): every client was cut off"),
            frames_lost=lambda: warn("the nodes transmit more than the bus can carry: the rest is lost"),
        )
        yield Serving(server, nodes, hub.port, None if joined is None else joined.name)


def _warn_of_doubles(devices: list[StrictDevice], wanted: ServeRequest, warn: Callable[[str], None]) -> None:
    """Warn of *devices* with the same node-ID."""
    for shared_id, many in Counter(device.node_id for device in devices).items():
        if many > 1 and shared_id != UNCONFIGURED:
            warn(f"{many} nodes have node-ID {shared_id}, as stored in {wanted.state}: they will answer as one node")


def _faults(options: Options, nodes: tuple[Simulated, ...]) -> tuple[Fault, ...]:
    """Return the faults of *nodes*; raises UsageError for a fault that a served bus cannot have."""
    faults = simulated_faults(options.fault, nodes)
    for fault in faults:
        if fault.kind.of_bit_rate:
            raise UsageError(
                "the bit rate of a served bus cannot change",
                given={"faults": fault},
                hint=Hint(Action.GIVE, {"nodes": None}, "it is for {}"),
            )
    return faults


def _latencies(wanted: tuple[tuple[int | None, float], ...], devices: list[StrictDevice]) -> list[float]:
    """Return the response time of each device (s); raises UsageError for an unknown node or a repetition."""
    said, here = dict(wanted), {device.node_id for device in devices}
    for said_id in said:
        if sum(other == said_id for other, _ in wanted) > 1:
            raise UsageError("given twice", given={"latency": said_id})
        if said_id is not None and said_id not in here:
            raise UsageError(
                "no such node here", given={"latency": said_id}, hint="NODE:MS is the node-ID of a node that is served"
            )
    return [said.get(device.node_id, said.get(None, 0.0)) for device in devices]


def _hub(where: tuple[str, int] | None, warn: Callable[[str], None]) -> Hub:
    from dvtcli.simulator.network.hub import Hub

    try:
        hub = Hub([] if where is None else [where], warn)
    except OSError as failed:
        host, port = where or (LOOPBACK, 0)
        raise BusUnavailable(
            f"cannot listen on {host}:{port}",
            why=failed.strerror or str(failed),
            hint=Hint(
                Action.GIVE,
                {"listen": "HOST:0"},
                "another server may be running there; {} uses a free port",
            ),
        ) from failed
    if where is not None and not is_loopback(where[0]):
        warn(f"{where[0]} is not a loopback address: everybody who can reach it can read and write these nodes")
    return hub


def _joined(options: Options, hub: Hub, on_bus_event: OnBusEvent) -> JoinedBus:
    from dvtcli.operations.session.open_network import first_bus, waited_for
    from dvtcli.simulator.network.shared_bus import JoinedBus

    def opened() -> CanopenBus:
        from dvtcli.bus.opening import open_bus

        return open_bus(options.interface, options.channel, options.bitrate, options.adapter_settings)

    bus = first_bus(opened, options, on_bus_event)
    if not options.reconnect or options.no_reconnect:
        return JoinedBus(bus, hub.wake)
    return JoinedBus(
        bus, hub.wake, lambda gone, failed, stopping: waited_for(opened, gone.name, failed, stopping, on_bus_event)
    )


def _keeper(
    folder: Path | None, nodes: tuple[Simulated, ...], devices: list[StrictDevice], warn: Callable[[str], None]
) -> Callable[[StrictDevice], None]:
    """Load the stored values of *devices* from *folder*; returns the function that stores later values."""
    if folder is None:
        return lambda _device: None
    if folder.exists() and not folder.is_dir():
        raise InputFileError(
            f"{folder}: not a folder", place=str(folder), hint=Hint(Action.GIVE, {"state": None}, "takes a folder")
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)  # now, rather than when a node first stores
    except OSError as failed:
        why = failed.strerror or str(failed)
        raise UsageError(
            f"{folder}: {why}", place=str(folder), hint=Hint(Action.GIVE, {"state": None}, "takes a folder to write to")
        ) from failed
    names = [f"{node.family or node.eds.stem}@{node.node_id}.json" for node in nodes]
    paths = {device: folder / name for device, name in zip(devices, names, strict=True)}
    for device, path in paths.items():
        kept = read_state(path)
        if kept.node_id is not None:  # else it starts with what its file says
            device.power_on(kept.values, kept.node_id)

    def keep(device: StrictDevice) -> None:
        try:
            write_state(paths[device], device.lss.stored, device.areas.kept())
        except OSError as failed:
            why = failed.strerror or str(failed)
            warn(f"{paths[device]}: {why}; node {device.node_id} keeps what it stored only while sim runs")

    return keep
