"""The `tpdo` and `rpdo` of a node. Does not know what a device allows, nor what its objects are called."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from dvtcli.domain.cob_id import HIGHEST_BASE_CAN_ID, CobId
from dvtcli.domain.milliseconds import counts
from dvtcli.domain.network.wanted_state import FileWord, PdoWish
from dvtcli.domain.pdo import MAX_PDO_NUMBER, Direction, Pdo
from dvtcli.files.network import leaves
from dvtcli.files.network.file_log import FileLog, spelled
from dvtcli.files.network.known_keys import key_mark, number_key, read_keys
from dvtcli.files.network.network_keys import OF, Where
from dvtcli.files.network.yaml_tree import Branch, Leaf, Tree, YamlList

#: the keys of a PDO, the last of several that mean one sub-index; 0: the mapping
_SUB_INDICES = {
    "mapping": 0, "enabled": 1, "cob_id": 1, "transmission": 2, "inhibit_time": 3, "inhibit_ms": 3, "event_timer": 5,
    "event_deadline": 5, "sync_start": 6,
}  # fmt: skip


def read_pdos(branch: Branch, direction: Direction, title: str, log: FileLog) -> Iterator[PdoWish]:
    """The PDOs of *branch* by their numbers."""
    lines: dict[int, int] = {}
    for leaf, value in branch.items.values():
        if spelled(leaf.text) in OF[Where.TPDO if direction is Direction.TPDO else Where.RPDO]:
            log.complain(
                leaf.mark, f"{leaf.text!r} in {direction} of {title} belongs to a PDO: it stands below its number"
            )
            continue
        number = number_key(leaf, 1, MAX_PDO_NUMBER, "PDO number", log)
        if number is None:
            continue
        pdo = Pdo(direction, number)
        if number in lines:
            log.complain(leaf.mark, f"{pdo.label} of {title} is given twice (first at line {lines[number]})")
            continue
        lines[number] = leaf.mark.line
        if isinstance(value, Branch):
            yield replace(_pdo(pdo, value, f"{pdo.label} of {title}", log), mark=leaf.mark)
        elif isinstance(value, Leaf) and value.is_null:
            yield PdoWish(pdo, mark=leaf.mark)
        else:
            log.complain(value.mark, f"keys and values of {pdo.label} belong here, not {leaves.shown(value)}")


def _pdo(pdo: Pdo, branch: Branch, title: str, log: FileLog) -> PdoWish:
    found = read_keys(branch, Where.TPDO if pdo.is_tpdo else Where.RPDO, title, log)
    wish = PdoWish(
        pdo,
        enabled=found.get("enabled"),
        rtr_allowed=found.get("rtr_allowed"),
        transmission_type=found.get("transmission"),
        inhibit_time=_inhibit(branch, found, log),
        event_timer=found.get("event_timer" if pdo.is_tpdo else "event_deadline"),
        sync_start_value=found.get("sync_start"),
        mapping=_mapping(found["mapping"], title, log) if "mapping" in found else None,
        keys={sub_index: key_mark(branch, name) for name, sub_index in _SUB_INDICES.items() if name in branch.items},
    )
    return _with_cob_id(wish, found["cob_id"], branch, log) if "cob_id" in found else wish


def _inhibit(branch: Branch, found: dict[str, Any], log: FileLog) -> int | None:
    if "inhibit_time" in branch.items and "inhibit_ms" in branch.items:
        log.complain(key_mark(branch, "inhibit_ms"), "inhibit_ms and inhibit_time are the same: say one of them")
    elif "inhibit_ms" in found:
        try:
            return counts(found["inhibit_ms"], 100)
        except ValueError as wrong:
            log.complain(branch.items["inhibit_ms"][1].mark, str(wrong))
    return found.get("inhibit_time")


def _with_cob_id(wish: PdoWish, said: int | str, branch: Branch, log: FileLog) -> PdoWish:
    """*wish* with the COB-ID as dcfgen has it: bits 31, 30 and 29 are part of the number."""
    if said == "auto":
        return replace(wish, cob_id="auto")
    cob_id, mark = CobId.from_raw(int(said)), branch.items["cob_id"][1].mark
    if cob_id.can_id > HIGHEST_BASE_CAN_ID and not cob_id.extended:
        log.complain(mark, f"CAN-ID 0x{cob_id.can_id:X} has more than 11 bits; bit 29 (0x20000000) makes a 29-bit one")
    if not cob_id.rtr_allowed:
        if wish.rtr_allowed:
            log.complain(mark, "bit 30 of cob_id forbids RTR, and rtr_allowed allows it")
        wish = replace(wish, rtr_allowed=False)
    if not cob_id.valid:
        if wish.enabled:
            log.note(mark, "bit 31 of cob_id disables the PDO, whatever enabled says; so does dcfgen")
        wish = replace(wish, enabled=False)
        if not cob_id.can_id:
            return wish  # 0x80000000 says off, and no CAN-ID
    return replace(wish, cob_id=cob_id.can_id, extended=cob_id.extended)


def _mapping(row: YamlList, title: str, log: FileLog) -> tuple[FileWord, ...]:
    words = (_entry(tree, title, log) for tree in row.items)
    return tuple(word for word in words if word is not None)


def _entry(tree: Tree, title: str, log: FileLog) -> FileWord | None:
    if not isinstance(tree, Branch):
        return leaves.object_word(tree, log)
    found = read_keys(tree, Where.ENTRY, f"an object of {title}", log)
    if "index" not in found:
        return None
    bits = f"/{found['bits']}" if "bits" in found else ""
    return FileWord(f"{found['index']:04X}:{found.get('sub_index', 0):02X}{bits}", tree.mark)
