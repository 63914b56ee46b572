"""A DBC file's messages as layouts, through cantools, which is an optional extra. Does not know CANopen."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from copy import copy
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.domain.datatypes import Value
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.physical import Physical
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.files.input_file import read_input
from dvtcli.watch.decoder import Address, Layout, Signal, SignalPlace
from dvtcli.watch.service import Service

if TYPE_CHECKING:
    from cantools.database.can import Message
    from cantools.database.can import Signal as DbcSignal

#: what cantools raises if a frame is not what its message says, the kinds of error that `except` takes
_Failures = tuple[type[Exception], ...]
#: a line that every DBC file has: its version, its nodes, or a message
_SECTION = re.compile(r"^[ \t]*(?:VERSION\b|NS_[ \t]*:|BS_[ \t]*:|BU_[ \t]*:|BO_\s)", re.MULTILINE)
#: no DBC of a machine is larger; cantools takes 4 s and more for each MB, and 0.1 ms for each message and signal
_MOST_BYTES, _MOST_ENTRIES = 2 << 20, 50_000
#: the length of a message in bytes, and where a signal begins and how long it is in bits
_SIZES = re.compile(r"^[ \t]*(?:BO_[ \t]+\d+[ \t]+\w+[ \t]*:[ \t]*(\d+)|SG_[^:\n]*:[ \t]*(\d+)\|(\d+)@)", re.MULTILINE)
#: what a message has at most (ISO 15765-2): cantools takes 200 bytes of memory for each byte of one
_MOST_MESSAGE_BYTES = 4095
_DESCRIBING = (".eds", ".dcf", ".xdd", ".xdc")
_TAKES = Hint(Action.GIVE_DBC, why="{} takes a DBC file or a network file (.yaml)")
_INSTEAD = Hint(Action.GIVE_DBC, {"file": "net.yaml"}, "a network file ({})") + Hint(
    Action.GIVE_EDS, why=" or {} decodes without it"
)


def read_dbc(file: str) -> dict[Address, Layout]:
    """The messages of *file*; UsageError where it is missing (or cantools is), InputFileError where it is no DBC."""
    path = Path(file)
    try:
        text = read_input(path, _MOST_BYTES, "DBC").decode("cp1252", errors="replace")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", hint=_TAKES) from failed
    if not _SECTION.search(text):
        raise InputFileError(
            f"{path.name} is no DBC file", why="it has no section of one", hint=_hint(path), place=file
        )
    _refuse_sizes(text, path)
    cantools = extra("cantools", "dbc", f"reading {path.name}, a DBC file,", instead=_INSTEAD)
    try:
        database = cantools.database.load_string(text, "dbc")
    except (cantools.Error, ValueError, KeyError, IndexError, AttributeError) as wrong:
        raise InputFileError(f"{path.name} is no DBC file", why=_first_line(wrong), place=file) from wrong
    failures = (cantools.Error, ValueError, OverflowError)
    return {
        (message.frame_id, message.is_extended_frame): _layout(message, path.name, failures)
        for message in database.messages
    }


def _refuse_sizes(text: str, path: Path) -> None:
    """InputFileError if a message or a signal is larger than any that is sent, or there are too many."""
    for number, found in enumerate(_SIZES.finditer(text)):
        if number >= _MOST_ENTRIES:
            what = f"more than {_MOST_ENTRIES:,} messages and signals"
            raise InputFileError(f"{path.name}: {what}", place=str(path), why="no DBC of a machine has so many")
        length, *bits = (0 if digits is None else int(digits[:20]) for digits in found.groups())
        if length > _MOST_MESSAGE_BYTES or any(bit > 8 * _MOST_MESSAGE_BYTES for bit in bits):
            line = text.count("\n", 0, found.start()) + 1
            raise InputFileError(
                f"{path.name}:{line}: no message has more than {_MOST_MESSAGE_BYTES} bytes", place=f"{path}:{line}"
            )


def _hint(path: Path) -> Hint:
    """What to do with a file that is none."""
    described = path.suffix.lower() in _DESCRIBING
    takes = Hint(Action.GIVE_EDS, {"file": path.name}, "takes an EDS, DCF, XDD or XDC")
    return takes if described else _TAKES


def _first_line(wrong: Exception) -> str:
    return str(wrong).partition("\n")[0] or type(wrong).__name__


def _layout(message: Message, file: str, failures: _Failures) -> Layout:
    signals = tuple(Signal(one.name, one.name, "", _meaning(one), place=_place(one)) for one in message.signals)
    read = _reader(message, failures)
    return Layout(Service("message", message.name), signals, read, byte_length=message.length, source=file)


def _place(signal: DbcSignal) -> SignalPlace:
    return SignalPlace(signal.start, signal.length, signal.byte_order == "big_endian")


def _meaning(signal: DbcSignal) -> Physical:
    """The unit: what cantools decodes is scaled already, and is shown as it is."""
    return Physical(signal.unit or "")


def _reader(message: Message, failures: _Failures) -> Callable[[bytes], list[Value | None]]:
    """A function that decodes a frame's data into a value for each signal, None for a signal that it does not hold."""
    names = [signal.name for signal in message.signals]
    alone: list[Message] = []

    def read(data: bytes) -> list[Value | None]:
        try:
            decoded: Any = message.decode(data, decode_choices=False, allow_truncated=True)
        except failures:  # a multiplexor's value that the file does not describe, or a signal that is no number
            if not alone:
                alone.extend(_alone(message, signal) for signal in message.signals)
            return _one_by_one(message.signals, alone, data, failures)
        return [_number(decoded.get(name)) for name in names]

    return read


def _alone(message: Message, signal: DbcSignal) -> Message:
    """A message of the same length that holds *signal* only, whatever its multiplexor says."""
    single = copy(signal)
    single.is_multiplexer, single.multiplexer_ids, single.multiplexer_signal = False, None, None
    return message.__class__(message.frame_id, message.name, message.length, [single], strict=False)


def _one_by_one(signals: list[DbcSignal], alone: list[Message], data: bytes, failures: _Failures) -> list[Value | None]:
    """The value of each of *signals* that *data* holds and that its multiplexors choose; *alone* decodes each."""
    values: list[Value | None] = []
    for single in alone:
        try:
            decoded: Any = single.decode(data, decode_choices=False, allow_truncated=True)
        except failures:  # no value, as of a signal behind the frame's end
            decoded = {}
        values.append(next(iter(decoded.values()), None))
    multiplexors = {
        signal.name: (signal, value) for signal, value in zip(signals, values, strict=True) if signal.is_multiplexer
    }
    return [
        _number(value) if _is_chosen(signal, multiplexors) else None
        for signal, value in zip(signals, values, strict=True)
    ]


def _is_chosen(signal: DbcSignal, multiplexors: Mapping[str, tuple[DbcSignal, Value | None]]) -> bool:
    """Whether each multiplexor above *signal* has a value with which *signal* is in the frame."""
    while signal.multiplexer_signal is not None:
        multiplexor, value = multiplexors[signal.multiplexer_signal]
        if (
            not isinstance(value, int | float)
            or not isfinite(value)
            or int(value) not in (signal.multiplexer_ids or ())
        ):
            return False
        signal = multiplexor
    return True


def _number(value: Value | None) -> Value | None:
    """*value*; None for an integer that a factor made larger than a double holds, as nobody can draw or compare it."""
    if isinstance(value, int):
        try:
            float(value)
        except OverflowError:
            return None
    return value
