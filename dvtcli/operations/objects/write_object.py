"""Write an object by the rules of the command for it, from text or a file; and read an object into a file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dvtcli.bus.sdo.client import MOST_BYTES
from dvtcli.device.store.store_parameters import SIGNATURES
from dvtcli.domain.abort import Abort
from dvtcli.domain.can_ids import SDO_REQUEST_BASE, SDO_RESPONSE_BASE
from dvtcli.domain.datatypes import Kind, parse_number
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_syntax import resolve_object
from dvtcli.domain.objects import CONCISE_DCF, RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.profile import within
from dvtcli.domain.rules.finding import ERROR, Rule, error
from dvtcli.errors import DeviceRefused, InputFileError, RuleError, UsageError
from dvtcli.files.input_file import read_input
from dvtcli.operations.changes.change import change_result
from dvtcli.operations.changes.store_restore import restore_defaults, store_settings
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, place_of
from dvtcli.operations.session.whole_file import write_whole
from dvtcli.operations.values.named_objects import object_at, refuse_whole
from dvtcli.operations.values.object_values import (
    how_to_write,
    scaling_of,
    scalings_of,
    typed_bytes,
    value_words,
)
from dvtcli.operations.values.write_type import object_type

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.domain.datatypes import DataType
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.ports import Frame
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.operations.results import Changed, Stored
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

RULES = (
    Rule("signature", ERROR, "`write` to 0x1010 or 0x1011 with a value other than its signature",
         "CiA 301, 7.5.2.13 and 7.5.2.14", (Abort.CANNOT_STORE,)),
)  # fmt: skip
_GUESSED = Hint(
    Action.GIVE, {"as_type": "vs"}, "no EDS says its type, it is guessed by its length: {} writes text"
) + Hint(Action.GIVE, {"as_type": "TYPE"}, ", {} another one")


def write_text(
    session: SessionNodes, node: Node, index: int, sub_index: int, value: str, asked: DataType | None = None
) -> Changed | Stored:
    """Write the typed *value* as type *asked* or the object's type; raises UsageError if it does not fit."""
    if index in SIGNATURES and (not session.options.force or _is_signature(index, value)):
        return signature(session, node, index, sub_index, value)
    return write_bytes(session, node, index, sub_index, _encoded(node, index, sub_index, value, asked))


def write_bytes(session: SessionNodes, node: Node, index: int, sub_index: int, data: bytes) -> Changed:
    """Write and verify *data*; rolled back if the read-back differs. Asks first for 0x1F22."""
    if index == CONCISE_DCF and sub_index:
        from dvtcli.operations.session.consent import consent_to_concise

        consent_to_concise(session, node, sub_index, data)
    started = time.monotonic()
    try:
        applied = node.write(index, sub_index, data, force=session.options.force)
    except DeviceRefused as refused:
        _in_words(node, index, sub_index, refused)
        raise
    return change_result(session, node, applied, time.monotonic() - started)


def _in_words(node: NodeDescription, index: int, sub_index: int, refused: DeviceRefused) -> None:
    """Add to *refused* the values read back, and what may have written them."""
    if refused.read_back is None:
        return
    held, wanted = (value_words(node, index, sub_index, data) for data in refused.read_back)
    if held != wanted:
        refused.why = f"0x{index:04X}:{sub_index:02X} is {held}, expected {wanted}"
    group = next((name for name, drive_group in node.profile.vpdo.items() if within(index, drive_group.drives)), None)
    if group is not None:
        refused.hint = Hint(
            Action.SHOW_VPDO, {"group": group}, "the device itself writes it while a virtual PDO ties it: {} shows that"
        )


def refuse_unfit(
    dictionaries: Callable[[], Iterable[tuple[ObjectDictionary, DeviceProfile]]],
    object_text: str,
    value: str,
    asked: DataType | None,
) -> None:
    """Raise UsageError for a whole number *value* that is out of the range of type *asked*, or of the object's type.

    *dictionaries* returns those that may describe the node: the number is refused if the object of none can hold it.
    """
    if not _is_whole_number(value):
        return
    failure: UsageError | None = None
    for dictionary, profile in dictionaries():
        try:
            place = resolve_object(object_text, dictionary, profile.aliases)
        except ValueError:
            return
        entry = dictionary.entry(*place)
        kind = asked or (None if entry is None else entry.data_type)
        if kind is None or kind.kind not in _WHOLE_NUMBERS:
            return
        try:
            kind.parse(value)
        except ValueError as wrong:
            hint = how_to_write(scalings_of(profile, dictionary).of(*place), kind, value)
            failure = failure or UsageError(_unfit(value, *place, kind, wrong), hint=hint)
        else:
            return
    if failure is not None:
        raise failure


#: kinds of types whose values are whole numbers in a range
_WHOLE_NUMBERS = (Kind.BOOLEAN, Kind.INTEGER, Kind.UNSIGNED)


def _is_whole_number(text: str) -> bool:
    try:
        parse_number(text)
    except ValueError:
        return False
    return True


def _unfit(value: str, index: int, sub_index: int, kind: DataType, why: ValueError) -> str:
    return f"{value!r} for 0x{index:04X}:{sub_index:02X} ({kind.short}): {why}"


def _encoded(node: ReadableNode, index: int, sub_index: int, value: str, asked: DataType | None) -> bytes:
    kind = asked or object_type(node, index, sub_index)
    meaning = scaling_of(node, index, sub_index)
    try:
        return typed_bytes(kind, meaning, value)
    except ValueError as wrong:
        guessed = None if asked or _is_known(node, index, sub_index) else _GUESSED
        raise UsageError(
            _unfit(value, index, sub_index, kind, wrong),
            node=node.node_id,
            hint=how_to_write(meaning, kind, value) or guessed,
        ) from wrong


def _is_known(node: NodeDescription, index: int, sub_index: int) -> bool:
    """Tell whether the object's type is in a file; else it is a number of its size."""
    entry = node.dictionary.entry(index, sub_index) if node.dictionary else None
    return entry is not None and entry.data_type is not None


def refuse_signature(node: NodeDescription, index: int) -> None:
    """Raises UsageError for 0x1010 and 0x1011, which accept only a signature."""
    if index in SIGNATURES:
        raise UsageError(f"0x{index:04X} takes a signature: use store() or restore()", node=node.node_id)


def _is_signature(index: int, value: str) -> bool:
    """Tell whether *value*, as typed, is the signature for *index*."""
    word = SIGNATURES[index]
    number = int.from_bytes(word, "little")
    return value.lower() in {word.decode(), f"0x{number:x}", str(number)}


def signature(session: SessionNodes, node: Node, index: int, sub_index: int, value: str) -> Stored:
    """Write the signature to 0x1010 or 0x1011, as `store` and `restore` do."""
    if not _is_signature(index, value):
        word, place = SIGNATURES[index], f"0x{index:04X}:{sub_index:02X}"
        finding = error(
            "signature", place, f"{place} takes {word.decode()!r} only, not {value!r}", Abort.CANNOT_STORE,
            Hint(Action.STORE if index == STORE_PARAMETERS else Action.RESTORE),
        )  # fmt: skip
        raise RuleError(f"nothing was written: {finding.text}", [finding], node=node.node_id)
    if index == RESTORE_PARAMETERS:
        return restore_defaults(session, node, sub_index, prove=False)
    return store_settings(session, node, sub_index)


_SEGMENT_BYTES, _EACH = 7, 64
#: responses that begin an upload with its size, by their bits: segmented, block
_SIZE_TOLD = ((0xE3, 0x41), (0xE3, 0xC2))


@contextmanager
def transfer_progress(session: SessionNodes, node_id: int, text: str, size: int | None = None) -> Iterator[None]:
    """Report the progress of a transfer during a block: *text*, and how much of *size* bytes; the bus is open.

    None is for an upload: its size is learnt on the way.
    """
    watch = _FrameCount(session, node_id, text, size)
    stop = session.wire.tap(watch.take)
    try:
        yield
    finally:
        stop()


class _FrameCount:
    """Counts the frames of a node's SDO channel."""

    def __init__(self, session: SessionUser, node_id: int, text: str, size: int | None) -> None:
        self._tell, self._text, self._size = session.reporter, text, size or 0
        self._carrier = (SDO_REQUEST_BASE if size is not None else SDO_RESPONSE_BASE) + node_id
        self._learns_size = size is None
        self._count = 0

    def take(self, frame: Frame, _sent: bool) -> None:
        """Count a frame (Tap); slightly too many, by a transfer's begin, end and repetitions."""
        if frame.can_id != self._carrier or len(frame.data) != 8:
            return
        if self._learns_size and any(frame.data[0] & mask == bits for mask, bits in _SIZE_TOLD) and self._count < 2:
            self._size, self._count = int.from_bytes(frame.data[4:], "little"), 0
        self._count += 1
        if self._count % _EACH == 0:
            done = min(self._count * _SEGMENT_BYTES, self._size) if self._size else 0
            of = f" of {self._size:,} bytes" if self._size else ""
            self._tell.progress(f"{self._text}: {done:,}{of}", done, self._size)


def read_to_file(session: SessionNodes, object_: str, file: str, node_id: int | None = None) -> Facts:
    """Read *object_* of node *node_id* or the selected node, and write its bytes to *file*, all or none.

    Asks before overwriting. Raises UsageError for an unknown name or an unwritable file; SdoAborted, NoAnswer.
    """
    path = place_of(file, "NAME.bin")
    node = session.node(node_id)
    refuse_whole(node, object_)
    index, sub_index = object_at(node, object_)
    ask_before_overwriting(session, path)
    place = f"{index:04X}:{sub_index:02X}"
    with transfer_progress(session, node.node_id, f"node {node.node_id}: reading 0x{place}"):
        data = node.upload(index, sub_index)
    write_whole(path, data)
    session.made.append(file)
    rows = (("node", node.node_id), ("object", place), ("file", file), ("bytes", len(data)))
    return Facts("object-file", rows, (f"{file}: {len(data):,} bytes of 0x{place} of node {node.node_id}",))


def write_from_file(session: SessionNodes, node: Node, index: int, sub_index: int, file: str) -> Changed:
    """Write the bytes of *file* to an object like `write`: verified, or rolled back.

    Raises UsageError if the file cannot be read, InputFileError if it is empty or larger than any object.
    """
    data = file_bytes(file)
    text = f"node {node.node_id}: writing 0x{index:04X}:{sub_index:02X}"
    with transfer_progress(session, node.node_id, text, len(data)):
        return write_bytes(session, node, index, sub_index, data)


def file_bytes(file: str) -> bytes:
    """Read *file*; raises UsageError if unreadable, InputFileError if empty or too large."""
    try:
        data = read_input(file, MOST_BYTES, "object")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    if not data:
        raise InputFileError(f"{file} is empty", place=file)
    return data
