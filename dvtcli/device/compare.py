"""Differences between two configurations of a PDO, in a person's words. Reads nothing."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.pdo import Pdo, PdoConfig


def differences(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> list[str]:
    """Every parameter of *pdo* in which *held* is not *wanted*, in a person's words.

    Half a PDO, as a file may list one, wishes nothing of the other half.
    """
    return [
        *(_in_communication(pdo, wanted, held) if wanted.has_cob_id else ()),
        *(_in_mapping(pdo, wanted, held) if wanted.has_mapping else ()),
    ]


def _in_communication(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_cob_id:
        yield f"its COB-ID 0x{pdo.communication_index:04X}:01 cannot be read"
        return
    rows = (
        ("COB-ID", f"0x{held.communication.cob_id.raw:08X}", f"0x{wanted.communication.cob_id.raw:08X}"),
        ("transmission type", held.communication.transmission_type, wanted.communication.transmission_type),
        ("inhibit time", held.communication.inhibit_time, wanted.communication.inhibit_time),
        ("event timer", held.communication.event_timer, wanted.communication.event_timer),
        ("SYNC start value", held.communication.sync_start_value, wanted.communication.sync_start_value),
    )
    for name, is_now, should in rows:
        if is_now != should:
            yield f"{name} is {is_now}, expected {should}"


def _in_mapping(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_mapping:
        yield f"its mapping 0x{pdo.mapping_index:04X}:00 cannot be read"
        return
    if held.mapping != wanted.mapping:
        texts = [" ".join(map(str, config.mapping)) or "nothing" for config in (held, wanted)]
        yield f"0x{pdo.mapping_index:04X} maps {texts[0]}, expected {texts[1]}"
    if held.count != wanted.count and (held.held_count, wanted.held_count) != (None, None):
        yield f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}"
