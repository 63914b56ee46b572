"""Differences between two configurations of a PDO, in words. Reads nothing."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE


def differences(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> list[str]:
    """Every parameter of *pdo* that differs between *held* and *wanted*, in words.

    A part missing from *wanted* (a file may list half a PDO) and unreadable parameters are not compared.
    """
    return [
        *(_in_communication(pdo, wanted, held) if wanted.has_cob_id else ()),
        *(_in_mapping(pdo, wanted, held) if wanted.has_mapping else ()),
    ]


def _in_communication(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_cob_id:
        yield f"its COB-ID 0x{pdo.communication_index:04X}:01 cannot be read"
        return
    is_now, should = held.communication, wanted.communication
    rows = (
        (1, "COB-ID", f"0x{is_now.cob_id.raw:08X}", f"0x{should.cob_id.raw:08X}"),
        (TRANSMISSION_TYPE, "transmission type", is_now.transmission_type, should.transmission_type),
        (INHIBIT_TIME, "inhibit time", is_now.inhibit_time, should.inhibit_time),
        (EVENT_TIMER, "event timer", is_now.event_timer, should.event_timer),
        (SYNC_START, "SYNC start value", is_now.sync_start_value, should.sync_start_value),
    )
    for sub_index, name, value, wish in rows:
        place = (pdo.communication_index, sub_index)
        if place in wanted.unread:
            continue
        if place in held.unread:
            yield f"{name} 0x{place[0]:04X}:{sub_index:02X} cannot be read"
        elif value != wish:
            yield f"{name} is {value}, expected {wish}"


def _in_mapping(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_mapping:
        yield f"its mapping 0x{pdo.mapping_index:04X}:00 cannot be read"
        return
    if held.mpdo != wanted.mpdo or held.multiplexed != wanted.multiplexed:
        yield from _as_multiplexed(pdo, wanted, held)
    elif held.mapping != wanted.mapping:
        texts = [" ".join(map(str, config.mapping)) or "nothing" for config in (held, wanted)]
        yield f"0x{pdo.mapping_index:04X} is {texts[0]}, expected {texts[1]}"
    if held.count != wanted.count and (held.held_count, wanted.held_count) != (None, None):
        yield f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}"


def _as_multiplexed(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    """The differences of an MPDO, or of a PDO that should be an MPDO."""
    if held.count != wanted.count:
        yield f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}"
    else:
        texts = [" ".join(map(str, config.multiplexed)) or "nothing" for config in (held, wanted)]
        yield f"0x{pdo.mapping_index:04X}:01 is {texts[0]}, expected {texts[1]}"
