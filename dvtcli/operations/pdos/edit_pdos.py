"""Edit a node's PDOs as `map` does: rules, plan and change; several, all or none, or the first TPDO with room."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dvtcli.device.change.change_guard import who_else
from dvtcli.device.change.private_file import write_private
from dvtcli.device.proposal import proposal
from dvtcli.domain.hint import Action, Hint, as_hint, verbatim
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.domain.profile import Severity
from dvtcli.domain.request import Cleared, PdoRequest, cleared
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.domain.rules.communication import timer_findings
from dvtcli.domain.text import join_some
from dvtcli.errors import DeviceRefused, DvtcliError, SafetyRefusal, UsageError
from dvtcli.files.pdo_yaml import MappingWord, read_pdo_yaml, write_pdo_yaml, wrong_at
from dvtcli.operations.changes.change import configure, mapped_names, scaled_changes
from dvtcli.operations.results import Changed
from dvtcli.operations.user.change_files import state_folder
from dvtcli.operations.values.named_objects import entry_at

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.object_syntax import MappedObject, Skipped
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.session.session import Session, SessionNodes

#: PDOs with their configurations
Configs = Mapping["Pdo", "PdoConfig"]


def judge_edited(node: ReadableNode, held: Configs, changed: Configs) -> dict[Pdo, tuple[Finding, ...]]:
    """Return what the rules say of each of *changed* PDOs of *node*, which *held* others before."""
    proposals = {pdo: proposal(node, pdo, held[pdo], want, changed) for pdo, want in changed.items()}
    return {pdo: (*check_pdo(proposed), *timer_findings(proposed)) for pdo, proposed in proposals.items()}


def plan_edited(session: Session, node_id: int, held: Configs, changed: Configs) -> Changed:
    """Return what `map` would write, tried on the node's twin; under --dry-run planned only, as the twin stays."""
    if session.dry_run:
        node = session.node(node_id)
        plan = edited_plan(node_id, held, changed)
        said = mapped_names(node, plan.changes), scaled_changes(node, plan.changes)
        findings = tuple(finding for found in judge_edited(node, held, changed).values() for finding in found)
        return Changed(node_id, plan, findings, dry_run=True, seconds=0.0, names=said[0], understood=said[1])
    with session.under(dry_run=True):
        return configure(session, session.node(node_id), changed)


def apply_edited(session: SessionNodes, node: Node, held: Configs, changed: Configs) -> Changed:
    """Write the *changed* PDOs as `map` does; raises SafetyRefusal if *node* no longer has what it *held*."""
    node.begin_change()
    changed_meanwhile = [pdo.label for pdo in changed if node.pdo(pdo) != held[pdo]]
    if changed_meanwhile:
        raise SafetyRefusal(
            f"{join_some(changed_meanwhile)} of node {node.node_id} is not what it was when the editor read it",
            node=node.node_id,
            hint=as_hint(f"{who_else(node.guard)}: look at it again before it is written"),
        )
    return configure(session, node, changed)


def edited_plan(node_id: int, held: Configs, changed: Configs) -> Plan:
    """Return the writes that make the *changed* PDOs of what the node *held*."""
    return Plan(node_id, tuple(plan_pdo(pdo, held[pdo], want) for pdo, want in changed.items()))


def pdo_as_text(session: SessionNodes, pdo: Pdo, node_id: int | None = None) -> str:
    """Return *pdo* of the node with *node_id* (None: the selected node) as YAML; raises UsageError for an MPDO."""
    node = session.node(node_id)
    config = node.pdo(pdo)
    if config.mpdo is not None:
        raise UsageError(f"{pdo.label} is a multiplexed PDO, which has no mapping to edit", node=node.node_id)
    names = [_name(node, entry) for entry in config.mapping]
    return write_pdo_yaml(pdo, config, names, f'node {node.node_id} "{node.title}"')


def configure_from_text(
    session: SessionNodes, pdo: Pdo, text: str, node_id: int | None = None, *, seen: str | None = None
) -> Changed:
    """Configure *pdo* by *text*, like `map`; raises UsageError or InputFileError with the faulty line.

    *seen* is the text before editing: raises SafetyRefusal if the node differs from it by now.
    """
    node, asked = session.node(node_id), read_pdo_yaml(text, pdo)
    if seen is not None:
        node.begin_change()
        if pdo_as_text(session, pdo, node_id) != seen:
            raise SafetyRefusal(
                f"{pdo.label} of node {node.node_id} changed after the editor was opened",
                node=node.node_id,
                hint=Hint(
                    Action.EDIT_PDO,
                    {"pdo": pdo},
                    f"{verbatim(who_else(node.guard))}: {{}} again shows its present values",
                ),
            )
    want = PdoRequest(
        asked.cob_id, asked.transmission_type, asked.inhibit_time, asked.event_timer, asked.sync_start_value,
        asked.rtr_allowed, asked.extended, asked.enabled,
        objects=None if asked.mapping is None else tuple(_resolved(word, node) for word in asked.mapping),
    )  # fmt: skip
    return configure(session, node, {pdo: want})


def save_text(pdo: Pdo, text: str) -> str:
    """Save an edited *text* that was not applied; returns where, or why not."""
    path = state_folder(None) / "edited" / f"{pdo}-{datetime.now(UTC).strftime('%Y%m%dT%H%M%S.%fZ')}.yaml"
    try:
        write_private(path, text)
    except (OSError, SafetyRefusal) as failed:
        return f"your text cannot be saved: {failed}"
    return f"your text is saved as {path}"


def _name(node: NodeDescription, entry: PdoMappingEntry) -> str:
    known = node.dictionary is not None and not entry.is_dummy
    return node.dictionary.display_name(entry.index, entry.sub_index) if known and node.dictionary else ""


def _resolved(word: MappingWord, node: NodeDescription) -> MappedObject | Skipped:
    try:
        return entry_at(node, word.text)
    except UsageError as wrong:
        error = wrong_at(word.line, wrong.text)
        error.hint = wrong.hint
        raise error from wrong


def switch(session: SessionNodes, node_id: int | None, pdos: Iterable[Pdo], want: AnyPdoRequest) -> Changed:
    """Configure all *pdos* of the node with *node_id* (None: the selected node) by *want*, all or none."""
    return configure(session, session.node(node_id), dict.fromkeys(pdos, want))


def clear_all(session: SessionNodes, node_id: int | None = None) -> Changed:
    """Clear every PDO of a node with a changeable mapping, all or none; raises DvtcliError if there are none.

    PDOs that the rules do not let be cleared stay, and are reported.
    """
    node = session.node(node_id)
    found = node.begin_change()
    dynamic = {pdo: config for pdo, config in node.known_pdos().items() if node.is_dynamic(pdo)}
    if not dynamic:
        raise DvtcliError(f"node {node.node_id} has no PDO whose mapping can be changed", node=node.node_id)
    wanted = [pdo for pdo, config in dynamic.items() if cleared(config) != config] or list(dynamic)
    refused = {} if session.options.force else _refused(node, {pdo: dynamic[pdo] for pdo in wanted})
    rest = [pdo for pdo in wanted if pdo not in refused] or wanted
    done = configure(session, node, dict.fromkeys(rest, Cleared()), found)
    left = (finding for pdo, finding in refused.items() if pdo not in rest)
    return replace(done, findings=(*done.findings, *left))


def _refused(node: ReadableNode, held: Mapping[Pdo, PdoConfig]) -> dict[Pdo, Finding]:
    """Return the PDOs of *held* that must not be cleared, with reasons."""
    found: dict[Pdo, Finding] = {}
    for pdo, config in held.items():
        errors = errors_in(check_pdo(proposal(node, pdo, config, cleared(config))))
        if errors:
            text = f"{pdo.label} is not changed and may be enabled: {errors[0].text}"
            found[pdo] = replace(errors[0], severity=Severity.WARNING, text=text, abort=None, hint=None)
    return found


_MOST_BITS = 64


def map_in_tpdo(
    session: SessionNodes, node_id: int, index: int, sub_index: int, can_id: int | None = None
) -> tuple[Finding, ...]:
    """Map an object behind the entries of the first enabled TPDO with room, else in the first disabled TPDO.

    Sets type 1 (every SYNC), inhibit time 0 and event timer 0, and stores nothing. Does nothing if an enabled TPDO maps
    the object. *can_id* selects the TPDO with this CAN-ID, else sets it on a disabled TPDO.
    """
    node = session.node(node_id)
    node.begin_change()
    tpdos = _tpdos(node)
    if any(_position(config, index, sub_index) is not None for config in tpdos.values() if config.enabled):
        return ()
    bits = node.length_of(index, sub_index) or 8 * len(node.upload(index, sub_index))
    pdo, kept = _with_room(node, tpdos, bits, can_id)
    asked = PdoRequest(
        cob_id=can_id, transmission_type=1, enabled=True,
        inhibit_time=None if tpdos[pdo].communication.inhibit_time is None else 0,
        event_timer=None if tpdos[pdo].communication.event_timer is None else 0,
        objects=(*kept, PdoMappingEntry(index, sub_index, bits)),
    )  # fmt: skip
    return configure(session, session.node(node_id), {pdo: asked}).findings


def _tpdos(node: ReadableNode) -> dict[Pdo, PdoConfig]:
    return {pdo: config for pdo, config in node.pdos().items() if pdo.is_tpdo}


def _with_room(
    node: ReadableNode, tpdos: Mapping[Pdo, PdoConfig], bits: int, can_id: int | None
) -> tuple[Pdo, tuple[PdoMappingEntry, ...]]:
    """Return a TPDO with room for *bits*, and its remaining entries; raises DeviceRefused if there is none."""
    usable = {pdo: config for pdo, config in tpdos.items() if node.is_dynamic(pdo) and not _is_odd(config)}
    for pdo, config in usable.items():
        right = can_id in (None, config.communication.cob_id.can_id)
        if config.enabled and right and config.bits + bits <= _MOST_BITS and _takes_entry(node, pdo, config):
            return pdo, config.mapping
    for pdo, config in usable.items():
        if not config.enabled:
            return pdo, ()
    raise DeviceRefused(
        f"no TPDO of node {node.node_id} has {bits} bits of room, and none is disabled",
        node=node.node_id,
        hint=Hint(Action.CLEAR, why="a TPDO first")
        + Hint(Action.MAP, {"pdo": "tpdo1"}, ", or map into one by name: {}"),
    )


def _is_odd(config: PdoConfig) -> bool:
    return config.mpdo is not None or bool(config.inconsistency)


def _takes_entry(node: NodeDescription, pdo: Pdo, config: PdoConfig) -> bool:
    object_ = node.dictionary[pdo.mapping_index] if node.dictionary and pdo.mapping_index in node.dictionary else None
    subs = len(object_.entries.keys() - {0}) if object_ is not None else 0
    return len(config.mapping) < min(subs or MAX_ENTRIES, node.profile.max_entries or MAX_ENTRIES)


def _position(config: PdoConfig, index: int, sub_index: int) -> int | None:
    """Return the first bit of an object in a PDO's frame, None if not mapped."""
    start = 0
    for entry in config.mapping:
        if (entry.index, entry.sub_index) == (index, sub_index):
            return start
        start += entry.bits
    return None


def locate_tpdo(session: SessionNodes, node_id: int, index: int, sub_index: int) -> str:
    """Return `TPDO1 0x181 bit 0` for the first TPDO with the object, enabled first; else `not mapped`."""
    tpdos = _tpdos(session.node(node_id))
    for pdo, config in sorted(tpdos.items(), key=lambda item: not item[1].enabled):
        start = _position(config, index, sub_index)
        if start is not None:
            where = str(config.communication.cob_id) if config.enabled else "off"
            return f"{pdo.label} {where} bit {start}"
    return "not mapped"
