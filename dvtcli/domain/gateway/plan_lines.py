"""A network plan as request lines for any CiA 309-3 gateway, in the order of `apply`, with NMT and stores."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from dvtcli.domain.gateway.gateway_words import QUOTED, quoted, value_text
from dvtcli.domain.gateway.requests import (
    Command,
    Nmt,
    Order,
    PdoEntry,
    Read,
    ReadPdo,
    Request,
    SetPdo,
    Write,
    WritePdo,
)
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan, phases
from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.plan import Change
from dvtcli.domain.step import Step
from dvtcli.domain.text import plural

_NMT = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "preop",
    NmtCommand.RESET_NODE: "reset node",
    NmtCommand.RESET_COMMUNICATION: "reset comm",
}


def format_request(request: Request) -> str:
    """The line for *request*, without its line end."""
    head = [] if request.sequence is None else [f"[{request.sequence}]"]
    where = [str(number) for number in (request.net, request.node) if number is not None]
    return " ".join([*head, *where, _command(request)])


def _command(request: Request) -> str:
    match request.command:
        case Read(index, sub_index, None):
            return f"r 0x{index:04X} {sub_index}"
        case Read(index, sub_index, data_type):
            return f"r 0x{index:04X} {sub_index} {data_type}"
        case Write(index, sub_index, data_type, data):
            return f"w 0x{index:04X} {sub_index} {data_type} {value_text(data_type, data, wide_as_hex=True)}"
        case Nmt(command):
            return _NMT[command]
        case Order(name, numbers):
            return " ".join([name, *map(str, numbers)])
        case ReadPdo(number):
            return f"r p {number}"
        case WritePdo(number, values):
            return " ".join([f"w p {number} {len(values)}", *map(_word, values)])
        case SetPdo() as pdo:
            kind = "tpdo" if pdo.is_tpdo else "rpdo"
            head = f"set {kind} {pdo.number} 0x{pdo.cob_id:X} {pdo.transmission} {len(pdo.entries)}"
            return " ".join([head, *map(_entry, pdo.entries)])


def _word(word: str) -> str:
    return quoted(word.removeprefix(QUOTED)) if word.startswith(QUOTED) else word


def _entry(entry: PdoEntry) -> str:
    return entry.data_type if entry.index is None else f"0x{entry.index:04X} {entry.sub_index} {entry.data_type}"


_STORE, _SAVE = 0x1010, b"save"
#: start of a comment that dvtcli's `run` executes
REQUIRED = "#! require "
_PHASES = ("producers off", "consumers off", "writing", "consumers on", "producers on")


@dataclass(frozen=True, slots=True)
class Around:
    """Actions besides writes for a node.

    *preop*: PDOs can only be set in PRE-OPERATIONAL; *start*: it was OPERATIONAL; *stores*: the sub-indices of 0x1010
    to store.
    """

    preop: bool = False
    start: bool = False
    stores: tuple[int, ...] = ()


def plan_lines(plan: NetworkPlan, around: dict[int, Around]) -> list[str]:
    """Request lines for *plan*, each with a comment above it; only comments if the plan is empty."""
    nodes = [node for node in plan.nodes if len(node.plan) or node.stores]
    lines = [
        f"# CiA 309-3 gateway lines: {plural(plan.writes, 'SDO download')} for {_plain(plan.file)}",
        *map(_who, plan.nodes),
    ]
    lines.append("# Nothing is read back and nothing rolled back: stop at the first answer that is an ERROR.")
    lines += required_lines(nodes)
    commands = list(_commands(nodes, around)) or ["nothing to do: every node already has the values of the file"]
    number = 0
    for command in commands:
        if isinstance(command, str):
            lines.append(f"# {command}")
        else:
            number += 1
            lines.append(format_request(Request(number, None, *command)))
    return lines


def required_lines(nodes: Iterable[NodePlan]) -> Iterator[str]:
    """Preconditions of the first line: `run` of dvtcli checks them, other programs read comments."""
    for node in nodes:
        known = [f"{name}=0x{value:08X}" for name, value in node.identity.items() if value is not None]
        if known:
            yield f"{REQUIRED}{node.node_id}:identity {' '.join(known)}"
        if node.needs_power_off:
            yield f"{REQUIRED}{node.node_id}:power-off"


def _commands(nodes: list[NodePlan], around: dict[int, Around]) -> Iterator[str | tuple[int, Command]]:
    """Comments, and commands with their nodes."""
    for node_id in (node.node_id for node in nodes if len(node.plan) and around[node.node_id].preop):
        yield f"node {node_id}: its PDOs are set in PRE-OPERATIONAL"
        yield node_id, Nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    for title, phase in zip(_PHASES, phases(node.plan for node in nodes), strict=True):
        for part in phase:
            for change, step in part.steps_in_order():
                yield from _written(part.node_id, change, step, title)
    for node_id in (node.node_id for node in nodes if node.stores):
        for store in around[node_id].stores:
            yield f"node {node_id}: store"
            yield node_id, Write(_STORE, store, "vs", _SAVE)
    for node_id in (node.node_id for node in nodes if len(node.plan) and around[node.node_id].start):
        yield f"node {node_id}: it was OPERATIONAL"
        yield node_id, Nmt(NmtCommand.START)


def _written(node_id: int, change: Change, step: Step, title: str) -> Iterable[str | tuple[int, Command]]:
    was = "" if step.before is None else f"; was {_shown(step.before)}"
    yield f"node {node_id}, {title}, {_plain(change.label)}: {_plain(step.reason)}{was}"
    yield node_id, _write(step)


def _write(step: Step) -> Write:
    """The write of *step*, as a number if its length allows."""
    name = f"u{8 * len(step.after)}" if 1 <= len(step.after) <= 8 else "os"
    return Write(step.index, step.sub_index, name, step.after)


def _shown(data: bytes) -> str:
    if 1 <= len(data) <= 8:
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    return f"{len(data)} bytes"


def _who(node: NodePlan) -> str:
    known = [f"{name} 0x{value:08X}" for name, value in node.identity.items() if value is not None]
    who = " ".join(filter(None, ("node", str(node.node_id), _plain(node.name))))
    return f"# {who}: {', '.join(known) or 'it has no readable identity (0x1018)'}"


def _plain(text: str) -> str:
    """*text* as printable ASCII for a comment."""
    return "".join(char if 0x20 <= ord(char) < 0x7F else "?" for char in text)
