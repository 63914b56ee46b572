"""Differences between two configurations of a PDO, in a person's words. Reads nothing."""

from __future__ import annotations

from dvtcli.domain.pdo import Pdo, PdoConfig


def differences(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> list[str]:
    """Every parameter of *pdo* in which *held* is not *wanted*, in a person's words."""
    found = []
    if held.has_cob_id != wanted.has_cob_id:
        found.append(f"0x{pdo.communication_index:04X}:01 {_read(held.has_cob_id)}")
    rows = (
        ("COB-ID", f"0x{held.communication.cob_id.raw:08X}", f"0x{wanted.communication.cob_id.raw:08X}"),
        ("transmission type", held.communication.transmission_type, wanted.communication.transmission_type),
        ("inhibit time", held.communication.inhibit_time, wanted.communication.inhibit_time),
        ("event timer", held.communication.event_timer, wanted.communication.event_timer),
        ("SYNC start value", held.communication.sync_start_value, wanted.communication.sync_start_value),
    )
    for name, is_now, should in rows:
        if is_now != should:
            found.append(f"{name} is {is_now}, expected {should}")
    if held.mapping != wanted.mapping:
        texts = [" ".join(map(str, config.mapping)) or "nothing" for config in (held, wanted)]
        found.append(f"0x{pdo.mapping_index:04X} maps {texts[0]}, expected {texts[1]}")
    if held.count != wanted.count and (held.held_count, wanted.held_count) != (None, None):
        found.append(f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}")
    if held.has_mapping != wanted.has_mapping:
        found.append(f"0x{pdo.mapping_index:04X}:00 {_read(held.has_mapping)}")
    return found


def _read(is_there: bool) -> str:
    return "can be read, could not" if is_there else "cannot be read"
