"""The layout of each PDO's frame for a page: bits by bytes, and a row for each object. Reads nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.domain.mapping import MAX_PDO_BITS
from dvtcli.domain.network.picture import NetworkPicture, PictureField, PictureNode, PicturePdo
from dvtcli.files.picture.picture_words import (
    bit_range,
    byte_count,
    cob_id,
    end_text,
    meaning_text,
    node_text,
    object_text,
    timing,
)

_COLOURS = 6


@dataclass(frozen=True, slots=True)
class BitCell:
    """So many neighbouring *bits* of one byte: those of field *number* (1 and up; 0: free), and what stands there."""

    bits: int
    number: int
    text: str
    colour: str


@dataclass(frozen=True, slots=True)
class FieldRow:
    """One object of a frame: its number, its bits in the frame, what it is, and as what others hear it."""

    number: int
    colour: str
    bits: str
    object: str
    name: str
    type_name: str
    meaning: str
    heard_as: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FrameCard:
    """A PDO as a page shows it."""

    anchor: str
    title: str
    node: str
    is_tpdo: bool
    cob_id: str
    facts: tuple[str, ...]
    partners: str
    bytes: tuple[tuple[int, tuple[BitCell, ...]], ...]
    rows: tuple[FieldRow, ...]


def frame_cards(picture: NetworkPicture) -> Iterator[FrameCard]:
    """A card for each PDO that is on, node by node; RPDOs first, as the standard counts."""
    pdos = {pdo.end: pdo for _, pdo in picture.pdos}
    for node, pdo in picture.pdos:
        if pdo.config.enabled:
            partners = [pdos[end] for end in pdo.partners]
            yield _card(picture, node, pdo, partners)


def _card(picture: NetworkPicture, node: PictureNode, pdo: PicturePdo, partners: list[PicturePdo]) -> FrameCard:
    odd = pdo.config.inconsistency if node.is_told else ""
    facts = filter(None, (byte_count(pdo), timing(pdo), odd))
    verb = "heard by" if pdo.is_tpdo else "hears"
    names = ", ".join(f"{end_text(end)} {_name(picture, end.node_id)}".rstrip() for end in pdo.partners)
    nobody = "nobody here hears it" if pdo.is_tpdo else "nobody here sends it"
    rows = tuple(_row(number, field, partners) for number, field in enumerate(pdo.fields, 1))
    return FrameCard(
        f"{pdo.end.pdo}-{node.node_id}", pdo.end.pdo.label, node_text(picture, node.node_id), pdo.is_tpdo,
        cob_id(pdo.identifier), tuple(facts), f"{verb} {names}" if names else nobody, tuple(_bytes(pdo)), rows,
    )  # fmt: skip


def _name(picture: NetworkPicture, node_id: int) -> str:
    node = picture.node(node_id)
    return "" if node is None else node.name


def _row(number: int, field: PictureField, partners: list[PicturePdo]) -> FieldRow:
    heard = [
        f"{end_text(partner.end)} {object_text(other)}"
        for partner in partners
        for other in partner.fields
        if not other.is_dummy and other.start_bit < field.end_bit and field.start_bit < other.end_bit
    ]
    named = "" if field.is_dummy else field.object
    return FieldRow(
        number, _colour(number, field), bit_range(field), named, field.label,
        field.type_name or f"{field.bits} bits", meaning_text(field.meaning), () if field.is_dummy else tuple(heard),
    )  # fmt: skip


def _colour(number: int, field: PictureField | None) -> str:
    return "free" if field is None or field.is_dummy else f"t{(number - 1) % _COLOURS}"


def _bytes(pdo: PicturePdo) -> Iterator[tuple[int, tuple[BitCell, ...]]]:
    """Each byte with its cells, from bit 7 down to bit 0."""
    last = min(max((field.end_bit for field in pdo.fields), default=0), MAX_PDO_BITS)
    for byte in range((last + 7) // 8):
        yield byte, tuple(reversed(list(_cells(pdo, byte))))


def _cells(pdo: PicturePdo, byte: int) -> Iterator[BitCell]:
    """The cells of one byte from bit 0 up."""
    bit, end = 8 * byte, 8 * byte + 8
    for number, field in enumerate(pdo.fields, 1):
        first, behind = max(field.start_bit, bit), min(field.end_bit, end)
        if first < behind:
            yield BitCell(behind - first, number, _text(field, first, behind), _colour(number, field))
    used = min(max((field.end_bit for field in pdo.fields), default=0), end)
    if used < end:
        yield BitCell(end - max(used, bit), 0, "free", "free")


def _text(field: PictureField, first: int, behind: int) -> str:
    """The name where a field begins; behind that which of its bits lie here."""
    if first == field.start_bit:
        return field.label
    return "" if field.is_dummy else f"{behind - field.start_bit - 1}…{first - field.start_bit}"
