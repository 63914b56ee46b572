"""Make DBC messages of NMT, SYNC, EMCY, heartbeat and SDO (CiA 301, 7.2).

CAN-IDs and times are those of the nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import SYNC_OVERFLOW
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.errors import UsageError
from dvtcli.files.dbc_text import NOBODY, DbcMessage, DbcSignal

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dvtcli.domain.network.network_state import NetworkState

_STATES = {state.value: "boot-up" if state is NmtState.INITIALISING else state.label.lower() for state in NmtState}
#: position of an expedited SDO's bytes; others have only the first byte in common
_SDO = (
    DbcSignal("Command", 0, 8), DbcSignal("Object_index", 8, 16), DbcSignal("Sub_index", 24, 8),
    DbcSignal("Data", 32, 32),
)  # fmt: skip
_EMCY = (
    DbcSignal("Error_code", 0, 16), DbcSignal("Error_register", 16, 8), DbcSignal("Manufacturer_data", 24, 40),
)  # fmt: skip


def service_messages(state: NetworkState, names: Mapping[int, str], services: Collection[str]) -> list[DbcMessage]:
    """Make the messages of *services*, from `SERVICES`; *names* by node-ID."""
    return [message for service in SERVICES if service in services for message in _BY_SERVICE[service](state, names)]


def _nmt(_state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    every = tuple(names.values())
    commands = {command.value: command.word for command in NmtCommand}
    yield DbcMessage(0, False, "NMT", 2, NOBODY, (
        DbcSignal("Command", 0, 8, values=commands, receivers=every),
        DbcSignal("Node_ID", 8, 8, values={0: "all nodes"}, receivers=every),
    ))  # fmt: skip


def _sync(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    senders = [node for node in state.nodes if node.produces_sync]
    periods_us = state.sync_periods_us
    identifiers = dict.fromkeys(sender.sync for sender in senders or state.nodes)
    counted = any((node.number(SYNC_OVERFLOW) or 0) > 1 for node in state.nodes)
    signals = (DbcSignal("Counter", 0, 8, receivers=tuple(names.values())),) if counted else ()
    for number, identifier in enumerate(identifiers):
        yield DbcMessage(
            *identifier, "SYNC" if not number else f"SYNC_{number + 1}", len(signals),
            names[senders[0].node_id] if len(senders) == 1 else NOBODY, signals,
            cycle_ms=round(periods_us[0] / 1000) if len(periods_us) == 1 else 0,
        )  # fmt: skip


def _emcy(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        if node.emcy is not None:
            name = names[node.node_id]
            yield DbcMessage(*node.emcy, f"{name}_EMCY", 8, name, _EMCY, f"emergency of node {node.node_id}")


def _heartbeat(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        watching = tuple(names[other.node_id] for other in state.nodes if node.node_id in other.watched)
        signals = (DbcSignal("State", 0, 7, values=_STATES, receivers=watching), DbcSignal("Toggle", 7, 1))
        yield DbcMessage(
            0x700 + node.node_id, False, f"{names[node.node_id]}_Heartbeat", 1, names[node.node_id], signals,
            f"heartbeat of node {node.node_id}; the toggle bit is of guarding", node.heartbeat_ms,
        )  # fmt: skip


def _sdo(state: NetworkState, names: Mapping[int, str]) -> Iterator[DbcMessage]:
    for node in state.nodes:
        name, node_id = names[node.node_id], node.node_id
        asked = tuple(DbcSignal(each.name, each.start, each.bits, receivers=(name,)) for each in _SDO)
        yield DbcMessage(0x600 + node_id, False, f"{name}_SDO_Req", 8, NOBODY, asked, f"SDO to node {node_id}")
        yield DbcMessage(0x580 + node_id, False, f"{name}_SDO_Ans", 8, name, _SDO, f"SDO from node {node_id}")


_BY_SERVICE: dict[str, Callable[[NetworkState, Mapping[int, str]], Iterator[DbcMessage]]] = {
    "nmt": _nmt, "sync": _sync, "emcy": _emcy, "heartbeat": _heartbeat, "sdo": _sdo,
}  # fmt: skip
#: the services by their words
SERVICES = tuple(_BY_SERVICE)


def services_of(text: str | None) -> tuple[str, ...]:
    """The services in *text*, with commas between them; UsageError for a word that is none."""
    words = tuple(word.strip().lower() for word in (text or "").split(",") if word.strip())
    if odd := [word for word in words if word not in SERVICES]:
        raise UsageError(
            "no such service",
            given={"services": odd[0]},
            hint=Hint(Action.GIVE, {"services": ",".join(SERVICES)}, "{}, or some of these"),
        )
    return words
