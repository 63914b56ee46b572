"""Proving a restore: what a node holds after it was reset, against the defaults of its EDS, or what it held before.

Does not know screens, and asks nobody.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.change.proving import AGAIN, RESTORE_ALL, Restart, acknowledged, uncovered_group, unread_of
from dvtcli.device.eds_defaults import differing_from_defaults, values_unlike_defaults
from dvtcli.device.snapshot import Snapshot
from dvtcli.device.store_parameters import Signed
from dvtcli.device.wish import Says, value_in_hex
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.pdo import PdoConfig
from dvtcli.domain.proof import Proof
from dvtcli.domain.several import join_some

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.object_dictionary import ObjectDictionary

#: What to do where the EDS tells no defaults.
_MANUAL = Hint(Action.SHOW_PDOS, why="shows what it holds; its manual may tell the defaults")


def _is_otherwise(before: PdoConfig, after: PdoConfig | None) -> bool:
    """Whether a PDO of which as much is told as *before* holds something else."""
    return after is not None and after.lacking == before.lacking and after != before


def restart_and_read(node: Node, restart: Restart) -> tuple[Snapshot, tuple[str, ...]]:
    """Restart *node*; what it holds then, and the labels of the changes that this took."""
    restart.run()
    lost = node.was_reset(communication=restart.communication)
    node.gate.renew()
    return Snapshot.now(node), lost


def prove_restore(
    node: Node, signed: Signed, restart: Restart, before: Snapshot | None,
    lost_before: tuple[str, ...] = (), says: Says = value_in_hex,
) -> Proof:  # fmt: skip
    """Restart *node*, whose restore was acknowledged, and compare what it holds with the defaults of the EDS.

    That are its PDOs, and the single objects that dvtcli wrote. *before* is what it held ahead of the restore.
    Without an EDS, or with that of another device, a PDO must differ from *before*, read after a restart that took
    *lost_before*. Values are said as *says* does.
    """
    with acknowledged(node, signed):
        after, lost = restart_and_read(node, restart)
    lost = (*lost_before, *lost)
    if node.dictionary is not None and not node.unlike_file:
        return _against_defaults(node, node.dictionary, signed, restart, before, after, lost, says)
    uncovered = uncovered_group(signed.sub_index)
    changed = sum(_is_otherwise(config, after.pdos.get(pdo)) for pdo, config in (before.pdos if before else {}).items())
    who = "the EDS is another device's" if node.unlike_file else "no EDS tells the defaults"
    unproved = f"{who}, and nothing differs from what was stored before"
    return Proof(
        restart.by, changed, "what was stored before", (), uncovered or ("" if changed else unproved), lost=lost,
        hint=RESTORE_ALL if uncovered else Hint(Action.GIVE_EDS, why="tells its defaults"), notes=after.notes,
    )  # fmt: skip


def _against_defaults(
    node: Node,
    dictionary: ObjectDictionary,
    signed: Signed,
    restart: Restart,
    before: Snapshot | None,
    after: Snapshot,
    lost: tuple[str, ...],
    says: Says,
) -> Proof:
    uncovered, against = uncovered_group(signed.sub_index), f"the defaults of {dictionary.source or 'the EDS'}"

    def look(held: Snapshot) -> Proof:
        pdos = differing_from_defaults(dictionary, node.profile, node.node_id, {} if uncovered else held.pdos)
        objects = values_unlike_defaults(dictionary, node.node_id, held.of_group(signed.sub_index), says)
        untold = join_some((*pdos.untold, *objects.untold))
        said = (f"not compared: {untold}, of which the EDS tells no default or the node no value",) if untold else ()
        return Proof(
            restart.by, pdos.compared, against, (*pdos.differences, *objects.differences), objects=objects.compared,
            notes=(*held.notes, *said),
        )  # fmt: skip

    found = look(after)
    told, unread = found.compared or found.objects, unread_of(after, signed)
    differed = set() if before is None else set(look(before).differing) - set(lost)  # a reset takes those anyway
    return replace(
        found,
        unproved=uncovered or unread or ("" if told else "the EDS tells no defaults of its PDOs"),
        lost=lost,
        hint=RESTORE_ALL if uncovered else AGAIN if unread else _MANUAL,
        already=not differed,
    )
