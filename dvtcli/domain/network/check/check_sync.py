"""Rules about SYNC: required, a single producer, and synchronous PDOs that fit its period."""

from __future__ import annotations

from dvtcli.domain.lint import ERROR, NOTE, WARNING, check
from dvtcli.domain.network.check.checked_network import CheckedNetwork, NetFound, at, held
from dvtcli.domain.objects import COB_ID_SYNC, CYCLE_PERIOD, SYNC_OVERFLOW, SYNC_WINDOW
from dvtcli.domain.standard_objects import source
from dvtcli.domain.text import join_some

_TYPES = f"{source(0x1400, 0x1800)}: transmission type"
_COUNTER = f"{source(0x1019, 0x1800)}: SYNC counter, SYNC start value"
_PRODUCER = "name who sends SYNC: sync_period: (µs) of master:, or sync_cob_id: 0x40000080 and sync_period: of a node"


@check(
    "sync-not-produced", ERROR, "PDOs are synchronous, no known node produces SYNC, and the file says that the master "
    "does not (`sync_period: 0`)", _TYPES, _PRODUCER,
)  # fmt: skip
def sync_not_produced(network: CheckedNetwork) -> NetFound:
    """Synchronous PDOs are never sent, and never take effect."""
    if _is_excluded(network):
        yield from _without_sync(network)


@check(
    "sync-from-elsewhere", WARNING, "PDOs are synchronous, no known node produces SYNC, and the file does not say "
    "whether the master does", _TYPES, _PRODUCER,
)  # fmt: skip
def sync_from_elsewhere(network: CheckedNetwork) -> NetFound:
    """A device outside the network has to send SYNC."""
    if network.traffic is not None and any(network.traffic.count(node.sync) for node in network.nodes):
        return  # somebody does
    if not _is_excluded(network):
        yield from _without_sync(network)


def _is_excluded(network: CheckedNetwork) -> bool:
    """Tell whether the file says that its master sends no SYNC, and names a synchronous PDO."""
    master, named = network.state.master, [row for row in network.synchronous if row[1] in row[0].marks]
    return master is not None and master.sync_period_us == 0 and bool(named or not network.state.file)


def _without_sync(network: CheckedNetwork) -> NetFound:
    if network.state.sync_periods_us or not network.synchronous:
        return
    listed = join_some(f"{node.node_id}:{pdo}" for node, pdo, _ in network.synchronous)
    first, pdo, _ = min(network.synchronous, key=lambda row: row[1] not in row[0].marks)
    yield at(first, pdo), f"no known node produces SYNC; these PDOs wait for it: {listed}"


@check("two-syncs", ERROR, "two send SYNC", "CiA 301, 7.2.5: one producer")
def two_syncs(network: CheckedNetwork) -> NetFound:
    """Synchronous PDOs come twice as often, at wrong times."""
    producers = [node for node in network.nodes if node.produces_sync]
    master = network.state.master
    first = "the master" if master is not None and master.sync_period_us else ""
    for node in producers:
        if first:
            yield held(node, COB_ID_SYNC), f"{first} sends SYNC, too"
        first = first or f"node {node.node_id}"


@check("sync-without-period", ERROR, "a node is SYNC producer, but its period is 0", source(0x1006))
def sync_without_period(network: CheckedNetwork) -> NetFound:
    """The node sends no SYNC."""
    for node in network.described:
        if node.produces(COB_ID_SYNC) and not node.number(CYCLE_PERIOD):
            yield held(node, CYCLE_PERIOD), "0x1005 makes it SYNC producer, but 0x1006 is 0"


@check("sync-window", ERROR, "synchronous PDOs may be received after the synchronous window (0x1007)", source(0x1007))
def sync_window(network: CheckedNetwork) -> NetFound:
    """Frames after the window are discarded."""
    for need in () if network.need is None else network.need.needs:
        stream = need.stream
        if stream.window_us is None or stream.node is None or not need.is_late:
            continue
        node = network.state.node(stream.node)
        if node is not None:
            late = "at any time" if need.response_us is None else f"{float(need.response_us) / 1000:.2f} ms after SYNC"
            yield at(node, stream.pdo), f"it may be received {late}; the window is {stream.window_us / 1000:g} ms"


@check("window-over-period", WARNING, "the window for synchronous PDOs (0x1007) is not below the period of SYNC",
       source(0x1006, 0x1007))  # fmt: skip
def window_over_period(network: CheckedNetwork) -> NetFound:
    """The window limits nothing."""
    period = min(network.state.sync_periods_us, default=None)
    for node in network.nodes:
        window = node.number(SYNC_WINDOW)
        if window and period and window >= period:
            yield held(node, SYNC_WINDOW), f"the window is {window} µs, the SYNC period {period} µs"


@check(
    "sync-start-without-counter",
    WARNING,
    "a TPDO waits for a value of the SYNC counter, but SYNC has no counter",
    _COUNTER,
)
def sync_start_without_counter(network: CheckedNetwork) -> NetFound:
    """The start value is ignored."""
    counted = any((node.number(SYNC_OVERFLOW) or 0) > 1 for node in network.nodes if node.produces_sync)
    for node, pdo, config in network.synchronous:
        if pdo.is_tpdo and config.communication.sync_start_value and not counted:
            yield at(node, pdo), f"its SYNC start value is {config.communication.sync_start_value}"


@check("sync-start-over-counter", ERROR, "a TPDO waits for a value that the SYNC counter never has", _COUNTER)
def sync_start_over_counter(network: CheckedNetwork) -> NetFound:
    """The PDO is never sent."""
    highest = max((node.number(SYNC_OVERFLOW) or 0 for node in network.nodes if node.produces_sync), default=0)
    for node, pdo, config in network.synchronous:
        start = config.communication.sync_start_value or 0
        if pdo.is_tpdo and highest > 1 and start > highest:
            yield at(node, pdo), f"its SYNC start value is {start}, the counter ends with {highest}"


@check(
    "sync-counters-differ", WARNING, "a SYNC consumer has another counter overflow value than the producer", _COUNTER
)
def sync_counters_differ(network: CheckedNetwork) -> NetFound:
    """The node sees jumps of the counter, and may send an EMCY for each."""
    producer = next((node for node in network.nodes if node.produces_sync), None)
    wanted = 0 if producer is None else producer.number(SYNC_OVERFLOW) or 0
    for node in network.nodes:
        own = node.number(SYNC_OVERFLOW)
        if producer is not None and own and own != wanted:
            yield held(node, SYNC_OVERFLOW), f"it counts to {own}, node {producer.node_id} to {wanted}"


@check("synchronous-without-sync", WARNING, "a node with synchronous PDOs has no 0x1005", source(0x1005))
def synchronous_without_sync(network: CheckedNetwork) -> NetFound:
    """It stays unknown whether the node receives SYNC."""
    for node in network.described:
        mine = [pdo for other, pdo, _ in network.synchronous if other is node]
        if mine and node.number(COB_ID_SYNC) is None:
            yield at(node, mine[0]), "it is synchronous, but the node has no 0x1005"


@check("reserved-type", ERROR, "an enabled PDO has a reserved transmission type", _TYPES)
def reserved_type(network: CheckedNetwork) -> NetFound:
    """241 to 251 are reserved, and 252 and 253 for RPDOs."""
    for node, pdo, config in network.enabled:
        kind = config.communication.transmission_type
        if kind is not None and 241 <= kind <= (251 if pdo.is_tpdo else 253):
            yield at(node, pdo), f"transmission type {kind} is reserved"


@check("sent-on-request", NOTE, "a TPDO is sent on request (RTR) only", "CiA 301, 7.2.2.5; CiA recommends against RTR")
def sent_on_request(network: CheckedNetwork) -> NetFound:
    """A master has to request it (RTR), which many controllers cannot."""
    for node, pdo, config in network.tpdos:
        if config.communication.transmission_type in (252, 253):
            yield at(node, pdo), "it is transmitted on remote request (RTR) only"
