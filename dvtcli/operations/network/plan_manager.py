"""Plan what a CANopen manager downloads to each node at boot-up (CiA 302-3, 0x1F22), by a network file.

Date and time (0x1F26, 0x1F27) come along: a manager skips the download to a node whose 0x1020 has them. Writes nothing:
the result is a plan for the manager. Nodes without an EDS in the file are identified; their values are not read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.read_pdos import UNREADABLE
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_plan import NetworkPlan, NodePlan
from dvtcli.domain.network.network_state import CONCISE_DCF
from dvtcli.domain.plan import STAMP, Plan
from dvtcli.domain.store import DATE, TIME
from dvtcli.domain.text import plural
from dvtcli.errors import SdoAborted, UsageError
from dvtcli.operations.changes.change import names
from dvtcli.operations.network.check_live import words_of_present
from dvtcli.operations.network.concise_network import concise_dcfs
from dvtcli.operations.plans.judge_network import check_plans
from dvtcli.operations.plans.plan_network import value_change
from dvtcli.operations.plans.read_network_config import named_nodes, read_network_config

if TYPE_CHECKING:
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.operations.network.concise_network import ConciseDcf
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.user.session_user import SessionUser

#: Sub-index of 0x1020 for these objects: expected configuration date and time.
_EXPECTED = {0x1F26: DATE, 0x1F27: TIME}
_NO_MANAGER = (
    "0x1F22 is the object of a CANopen manager (CiA 302-3) with its download values; check that the node-ID is the "
    "manager's"
)
_NOBODY = "it has no EDS; dcf: names an EDS"
_ITSELF = "it is the manager, which has no download for itself"


def plan_manager(session: Session, file: str, manager: int) -> NetworkPlan:
    """Plan the downloads of the node *manager* to each node of the network *file*.

    Reads the manager, and the identity of nodes without an EDS in the file: these must answer and match (else NoAnswer,
    SafetyRefusal, as of `plan_network`). Undescribed nodes are left out, reported, and `untold` in the plan. Raises
    UsageError if *manager* has no concise DCFs, no node is left, or `-n` names others; else as `concise_dcf`, and
    RuleError with all refusals of the rules.
    """
    if any(named_id != manager for named_id in named_nodes(session)):
        raise UsageError(
            f"node {manager} gets the download values of all nodes of {file}, but only some nodes were named",
            given={"to_manager": manager},
            hint=Hint(
                Action.GIVE,
                {"node_id": None},
                "leave out {} to write all; a download that is already right is not written",
            ),
        )
    config = read_network_config(file)
    found = concise_dcfs(file, session.reporter, words_of_present(session, file, config))
    mine = [dcf for dcf in found.nodes if dcf.node_id != manager]
    left_out = {(node_config.node_id, node_config.name): _NOBODY for node_config in found.untold}
    left_out |= {
        (node_config.node_id, node_config.name): _ITSELF
        for node_config in config.nodes
        if node_config.node_id == manager
    }
    for (node_id, name), why in sorted(left_out.items()):
        session.reporter.note(f"{file}: node {node_id} {name} is left out: {why}")
    if not mine:
        raise UsageError(f"{file} has no node for node {manager} to configure", place=file)
    node = session.node(manager)
    boot_ups = session.bus.boot_ups(manager)
    node.read_anew()
    planned = replace(_node_plan(session, node, mine), boot_ups=boot_ups)
    nodes = tuple(check_plans({manager: node}, [planned], force=session.options.force))
    untold = tuple(node_config.node_id for node_config in found.untold if node_config.node_id != manager)
    return NetworkPlan(file, nodes, manager=manager, untold=untold)


def _node_plan(session: SessionUser, node: ReadableNode, mine: list[ConciseDcf]) -> NodePlan:
    """Plan the writes to the manager *node* for *mine*, as far as it has the objects."""
    held = {place: data for dcf in mine for place, data in _held(node, dcf)}
    wanted = {place: data for dcf in mine for place, data in _wanted(dcf).items() if place in held}
    counts = {dcf.node_id: len(dcf.entries) for dcf in mine}
    changes = tuple(
        value_change(node, place, held[place], data, _reason(place, counts)) for place, data in wanted.items()
        if data != held[place]
    )  # fmt: skip
    for index in _lacking(held, mine):
        session.reporter.note(
            f"node {node.node_id} has no 0x{index:04X}: it downloads at each boot-up, whatever 0x1020 is"
        )
    said = tuple(
        replace(finding, text=f"node {each.node_id}: {finding.text}") for each in mine for finding in each.findings
    )
    return NodePlan(
        "manager", Plan(node.node_id, changes), node.identity(), node.title,
        values=wanted, names=names(node, changes), findings=said,
    )  # fmt: skip


def _wanted(one: ConciseDcf) -> dict[tuple[int, int], bytes]:
    """Return the manager's wanted values of a node; no date without a stamp: an old date would skip the download."""
    stamp = {entry.sub_index: entry.data for entry in one.entries if entry.index == STAMP}
    expected = {(index, one.node_id): stamp.get(sub_index, bytes(4)) for index, sub_index in _EXPECTED.items()}
    return {(CONCISE_DCF, one.node_id): one.data, **expected}


def _held(node: ReadableNode, one: ConciseDcf) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Yield the manager's values of a node; date and time are optional for a manager."""
    try:
        yield (CONCISE_DCF, one.node_id), node.observed(partial(node.known_value, CONCISE_DCF, one.node_id))
    except SdoAborted as aborted:
        raise no_manager(node, f"1F22:{one.node_id:02X}", aborted) from aborted
    for index in _EXPECTED:
        try:
            yield (index, one.node_id), node.observed(partial(node.known_value, index, one.node_id))
        except SdoAborted as aborted:
            if aborted.code not in UNREADABLE:
                raise


def no_manager(node: NodeDescription, place: str, aborted: SdoAborted) -> UsageError:
    """Make the error for *node* without concise DCFs: reading *place* was *aborted*."""
    text = f"node {node.node_id} ({node.title}) does not return its 0x{place}: {aborted.text}"
    return UsageError(text, node=node.node_id, place=place, hint=_NO_MANAGER)


def _lacking(held: Mapping[tuple[int, int], bytes], mine: list[ConciseDcf]) -> list[int]:
    """List which of date and time the manager lacks for nodes with a stamp."""
    stamped = [dcf.node_id for dcf in mine if any(entry.index == STAMP for entry in dcf.entries)]
    return [index for index in _EXPECTED if any((index, node_id) not in held for node_id in stamped)]


def _reason(place: tuple[int, int], downloads: Mapping[int, int]) -> str:
    index, node_id = place
    if index == CONCISE_DCF:
        return f"node {node_id}: {plural(downloads[node_id], 'download')} when it boots"
    return f"node {node_id}: expected {'date' if _EXPECTED[index] == DATE else 'time'}"
