"""A DBC file's messages as layouts, through cantools, which is an optional extra. Does not know CANopen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.domain.datatypes import Value
from dvtcli.domain.physical import Physical
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.watch.decoder import Address, Layout, Signal
from dvtcli.watch.service import Service

if TYPE_CHECKING:
    from cantools.database.can import Message
    from cantools.database.can import Signal as DbcSignal


def read_dbc(file: str) -> dict[Address, Layout]:
    """The messages of *file*; UsageError where it is missing (or cantools is), InputFileError where it is no DBC."""
    cantools = extra("cantools", "dbc", "reading a DBC file")
    path = Path(file)
    try:
        text = path.read_bytes().decode("cp1252", errors="replace")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", hint="-d takes the path of a DBC file") from failed
    try:
        database = cantools.database.load_string(text, "dbc")
    except (cantools.Error, ValueError, KeyError, IndexError, AttributeError) as wrong:
        raise InputFileError(f"{path.name} is no DBC file", why=_first_line(wrong), place=file) from wrong
    return {(one.frame_id, one.is_extended_frame): _layout(one) for one in database.messages}


def _first_line(wrong: Exception) -> str:
    return str(wrong).partition("\n")[0] or type(wrong).__name__


def _layout(message: Message) -> Layout:
    signals = tuple(Signal(one.name, one.name, "", _meaning(one)) for one in message.signals)
    return Layout(Service("message", message.name), signals, _reader(message))


def _meaning(signal: DbcSignal) -> Physical:
    """The unit: what cantools decodes is scaled already, and is shown as it is."""
    return Physical(signal.unit or "")


def _reader(message: Message) -> Callable[[bytes], list[Value | None]]:
    names = [one.name for one in message.signals]

    def read(data: bytes) -> list[Value | None]:
        decoded: Any = message.decode(data, decode_choices=False, allow_truncated=True)
        return [decoded.get(name) for name in names]

    return read
