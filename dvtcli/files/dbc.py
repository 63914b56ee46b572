"""A DBC file's messages as layouts, through cantools, which is an optional extra. Does not know CANopen."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dvtcli.domain.datatypes import Value
from dvtcli.domain.physical import Physical
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.files.input_file import read_input
from dvtcli.watch.decoder import Address, Layout, Signal
from dvtcli.watch.service import Service

if TYPE_CHECKING:
    from cantools.database.can import Message
    from cantools.database.can import Signal as DbcSignal

#: a line that every DBC file has: its version, its nodes, or a message
_SECTION = re.compile(r"^[ \t]*(?:VERSION\b|NS_[ \t]*:|BS_[ \t]*:|BU_[ \t]*:|BO_\s)", re.MULTILINE)
#: no DBC of a machine is larger
_MOST_BYTES = 32 << 20
_DESCRIBING = (".eds", ".dcf", ".xdd", ".xdc")
_TAKES = "-d takes a DBC file or a network file (.yaml)"
_INSTEAD = "a network file (-d net.yaml) or --eds FILE decodes without it"


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
    cantools = extra("cantools", "dbc", f"reading {path.name}, a DBC file,", instead=_INSTEAD)
    try:
        database = cantools.database.load_string(text, "dbc")
    except (cantools.Error, ValueError, KeyError, IndexError, AttributeError) as wrong:
        raise InputFileError(f"{path.name} is no DBC file", why=_first_line(wrong), place=file) from wrong
    return {(one.frame_id, one.is_extended_frame): _layout(one, path.name) for one in database.messages}


def _hint(path: Path) -> str:
    """What to type for a file that is none."""
    described = path.suffix.lower() in _DESCRIBING
    return f"--eds {path.name} takes an EDS, DCF, XDD or XDC" if described else _TAKES


def _first_line(wrong: Exception) -> str:
    return str(wrong).partition("\n")[0] or type(wrong).__name__


def _layout(message: Message, file: str) -> Layout:
    signals = tuple(Signal(one.name, one.name, "", _meaning(one)) for one in message.signals)
    return Layout(Service("message", message.name), signals, _reader(message), byte_length=message.length, source=file)


def _meaning(signal: DbcSignal) -> Physical:
    """The unit: what cantools decodes is scaled already, and is shown as it is."""
    return Physical(signal.unit or "")


def _reader(message: Message) -> Callable[[bytes], list[Value | None]]:
    names = [one.name for one in message.signals]

    def read(data: bytes) -> list[Value | None]:
        decoded: Any = message.decode(data, decode_choices=False, allow_truncated=True)
        return [decoded.get(name) for name in names]

    return read
