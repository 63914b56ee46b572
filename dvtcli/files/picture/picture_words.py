"""How a picture writes numbers and places: COB-IDs in hex, times in ms, shares in percent, PDOs as `5:TPDO1`."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.network.network_state import Identifier, identifier_text
from dvtcli.domain.network.picture import NetworkPicture, PictureField, PictureNode, PicturePdo
from dvtcli.domain.pdo import transmission_type_text
from dvtcli.domain.scaling import Scaling

_MOST_WORDS = 6


def cob_id(identifier: Identifier) -> str:
    """Return `0x181`; a 29-bit CAN-ID with eight digits."""
    return identifier_text(identifier)


def end_text(end: Endpoint) -> str:
    """`5:TPDO1`."""
    return f"{end.node_id}:{end.pdo.label}"


def ends_text(ends: Iterable[Endpoint]) -> str:
    """`5:RPDO1, 6:RPDO2`."""
    return ", ".join(map(end_text, ends))


def node_text(picture: NetworkPicture, node_id: int | None) -> str:
    """`5 feeder`: a node-ID with the node's name."""
    if node_id is None:
        return "-"
    node = picture.node(node_id)
    return f"{node_id} {node.label}" if node is not None and node.label != f"node {node_id}" else str(node_id)


def title_of(node: PictureNode) -> str:
    """`node 5 feeder`."""
    return node.label if node.label == f"node {node.node_id}" else f"node {node.node_id} {node.label}"


def ms(time_us: Fraction | None) -> str:
    """A time in ms."""
    if time_us is None:
        return "-"
    value = float(time_us) / 1000
    return f"{value:.2f} ms" if value < 100 else f"{value:.0f} ms"


def percent(share: Fraction | float | None) -> str:
    """Return a share of the bus as text; `no limit` if unbounded."""
    return "no limit" if share is None else f"{100 * float(share):.2f} %"


def kbit(bit_rate: int) -> str:
    """A bit rate in kbit/s."""
    return f"{bit_rate / 1000:g} kbit/s"


def byte_count(pdo: PicturePdo) -> str:
    """How long a PDO's frame is."""
    if pdo.config.mpdo is not None:
        return "multiplexed"
    if not pdo.config.has_mapping:
        return "layout not known"
    count = (pdo.config.bits + 7) // 8
    return f"{count} byte{'' if count == 1 else 's'}"


def timing(pdo: PicturePdo) -> str:
    """When a PDO is sent or taken, and how often at most."""
    held = pdo.config.communication
    kind = held.transmission_type
    words = [] if kind is None else [f"{transmission_type_text(kind, pdo.end.pdo.direction)} (type {kind})"]
    words += [f"inhibit {held.inhibit_time / 10:g} ms"] if held.inhibit_time else []
    words += [f"event timer {held.event_timer} ms"] if held.event_timer else []
    words += [f"SYNC start {held.sync_start_value}"] if held.sync_start_value else []
    return ", ".join(words)


def bit_range(field: PictureField) -> str:
    """Return a field's bits in the frame: `0–15`."""
    return f"{field.start_bit}–{field.end_bit - 1}" if field.bits > 1 else str(field.start_bit)


def object_text(field: PictureField) -> str:
    """`6041:00 Statusword`."""
    return f"{field.object} {field.name}".rstrip()


def meaning_text(meaning: Scaling) -> str:
    """Return the meaning of a raw value in a few words: `1/256 V`, `0 off, 1 on`, names of bits."""
    if meaning.has_number:
        return meaning.scale
    words = [f"{raw} {word}" for raw, word in sorted(meaning.values.items())]
    words += [state.text for state in meaning.states]
    words += [f"bit {bit} {name}" for bit, name in sorted(meaning.bits.items())]
    more = f" and {len(words) - _MOST_WORDS} more" if len(words) > _MOST_WORDS else ""
    return ", ".join(words[:_MOST_WORDS]) + more
