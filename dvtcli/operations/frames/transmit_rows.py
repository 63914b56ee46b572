"""Rows of a transmit list: a frame as typed, its period and its key; kept in the user's settings of the bus."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.domain.can_ids import SDO_REQUEST_BASE
from dvtcli.domain.datatypes import parse_number
from dvtcli.domain.frame import pack
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import normalised
from dvtcli.domain.object_syntax import parse_object
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.errors import UsageError
from dvtcli.files.settings_file import save_table
from dvtcli.files.user_folders import user_folder
from dvtcli.operations.frames.send_frames import frame_to_send
from dvtcli.operations.user.settings import TRANSMIT
from dvtcli.operations.values.object_values import how_to_write, scalings_of, typed_bytes
from dvtcli.watch.decoder import Layout, Signal, pdo_layouts

if TYPE_CHECKING:
    from dvtcli.domain.datatypes import DataType
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Address

#: keys that may send a row
KEYS = "123456789"
HOW = "185#1027, or rpdo1 6040=15; every 100ms and key 1 may stand behind it"
_TIME = re.compile(r"(\d{1,7}(?:\.\d{1,3})?)(ms|s)")
_FASTEST_S, _SLOWEST_S = 0.001, 3600.0


@dataclass(frozen=True, slots=True)
class TransmitRow:
    """A row of the list: *frame* as typed, *every_s* (s, None: once) and *key* (empty: none)."""

    frame: str
    every_s: float | None = None
    key: str = ""

    def __str__(self) -> str:
        period = "" if self.every_s is None else f" every {1000 * self.every_s:.10g}ms"
        return self.frame + period + (f" key {self.key}" if self.key else "")


def transmit_row(text: str) -> TransmitRow:
    """Parse `FRAME [every TIME] [key N]`; raises UsageError."""
    words, every_s, key = text.split(), None, ""
    while len(words) > 2 and words[-2] in ("every", "key"):
        name, value = words[-2:]
        del words[-2:]
        if name == "key":
            if value not in KEYS or len(value) != 1:
                raise UsageError(f"key {value}: a key is 1…9", hint=HOW)
            key = value
        else:
            every_s = _seconds(value)
    frame = " ".join(words)
    if not words:
        raise UsageError("no frame", hint=HOW)
    if not _names_pdo(frame):
        frame_to_send(frame)
    elif len(words) < 2 or not all("=" in word for word in words[1:]):
        raise UsageError(f"{frame}: values are OBJECT=VALUE", hint=HOW)
    return TransmitRow(frame, every_s, key)


def _seconds(text: str) -> float:
    found = _TIME.fullmatch(text)
    value = float(found[1]) * {"ms": 0.001, "s": 1.0}[found[2]] if found else 0.0
    if not _FASTEST_S <= value <= _SLOWEST_S:
        raise UsageError(f"every {text}: a period is 1ms…3600s", hint=HOW)
    return value


def _names_pdo(frame: str) -> bool:
    return re.match(r"(?i)(?:\d{1,3}:)?[tr]pdo\d", frame) is not None


def frame_of(session: SessionNodes, row: TransmitRow, last: Callable[[Address], bytes | None]) -> Frame:
    """Return the frame of *row*; objects of a PDO that it does not name keep the value in the *last* frame, else 0.

    Reads the mapping of the node. Raises UsageError for an unknown object or value.
    """
    if not _names_pdo(row.frame):
        return frame_to_send(row.frame)
    name, *values = row.frame.split()
    head, _, word = name.rpartition(":")
    node = session.node(int(head) if head else None)
    try:
        pdo = Pdo.parse(word)
    except ValueError as wrong:
        raise UsageError(str(wrong), hint=HOW) from wrong
    config = node.pdo(pdo)
    why = "multiplexed" if config.mpdo is not None else "" if config.enabled else "off"
    if why:
        raise UsageError(
            f"{pdo.label} of node {node.node_id} is {why}: it has no frame of values",
            hint=Hint(Action.SHOW_PDOS, why="shows what it is"),
        )
    scalings = scalings_of(node.profile, node.dictionary)
    ((address, layout),) = pdo_layouts(node.node_id, {pdo: config}, node.dictionary, scalings).items()
    before = int.from_bytes(last(address) or b"", "little")
    places = {}
    start = 0
    for entry in layout.mapping:
        places[entry] = start
        start += entry.bits
    given = dict(_given(layout, value) for value in values)
    data = pack(
        layout.mapping,
        lambda entry: given.get(entry.object, before >> places[entry] & (1 << entry.bits) - 1),
    )
    return Frame(address[0], data, address[1])


def _given(layout: Layout, text: str) -> tuple[str, int]:
    """Return the object in `OBJECT=VALUE` as printed, and its raw value."""
    name, _, value = text.partition("=")
    signal = _signal(layout, name)
    kind = signal.data_type
    try:
        if kind is None:
            raw = parse_number(value)
        else:
            raw = int.from_bytes(typed_bytes(kind, signal.meaning, value), "little", signed=_is_signed(kind))
    except ValueError as wrong:
        hint = None if kind is None else how_to_write(signal.meaning, kind, value)
        raise UsageError(f"{text}: {wrong}", hint=hint) from wrong
    if not -(1 << signal.bits - 1) <= raw < 1 << signal.bits:
        raise UsageError(f"{text}: {signal.object} has {signal.bits} bits in this PDO")
    return signal.object, raw


def _is_signed(kind: DataType) -> bool:
    return kind.limits is not None and kind.limits[0] < 0


def _signal(layout: Layout, name: str) -> Signal:
    try:
        numbers = parse_object(name)
    except ValueError as wrong:
        raise UsageError(str(wrong)) from wrong
    wanted = "" if numbers is None else f"{numbers[0]:04X}:{numbers[1]:02X}"
    for signal in layout.signals:
        if signal.object == wanted or (numbers is None and normalised(name) in normalised(signal.name)):
            return signal
    known = ", ".join(signal.object for signal in layout.signals)
    raise UsageError(f"{layout.service.label} has no {name}: it has {known or 'no objects'}", hint=HOW)


def kept_rows(session: SessionUser, bus: str) -> list[TransmitRow]:
    """Return the rows that the user's settings have for the *bus*; raises UsageError for a wrong row."""
    user = session.settings.user
    return [transmit_row(text) for text in ({} if user is None else user.transmit_rows).get(bus, [])]


def keep_rows(session: SessionUser, bus: str, rows: list[TransmitRow]) -> None:
    """Keep *rows* for the *bus* in the user's settings; raises InputFileError if they cannot be written.

    SDO requests are not kept: they may carry a passcode.
    """
    user = session.settings.user
    table = dict({} if user is None else user.transmit_rows)
    table[bus] = [str(row) for row in rows if not is_sdo_request(row)]
    if not table[bus]:
        del table[bus]
    save_table(user_folder("config") / "config.toml", TRANSMIT, table)
    session.settings.read_files()


def is_sdo_request(row: TransmitRow) -> bool:
    """Whether *row* is a frame to a node's default SDO server (0x600 + node-ID)."""
    if _names_pdo(row.frame):
        return False
    frame = frame_to_send(row.frame)
    return not frame.extended and frame.can_id & ~0x7F == SDO_REQUEST_BASE


def rounds(
    row: TransmitRow, frame: Frame, now_s: Callable[[], float], count: Callable[[int, int], None]
) -> Iterator[tuple[float, Frame]]:
    """Yield *frame* at the times of *row* (s from now) for ever, without those that are past by a period or more.

    *count* gets the number of frames before each, and of those that were left out.
    """
    began_s, period_s = now_s(), row.every_s or 0.0
    number = left_out = 0
    while True:
        past = int((now_s() - began_s) / period_s) - number if period_s else 0
        if past > 0:
            number, left_out = number + past, left_out + past
        count(number - left_out, left_out)
        yield number * period_s, frame
        number += 1
