"""A file that describes a device, as another one: EDS and XDD, DCF and XDC. Needs no bus.

What was written is read again, and compared with what was read: every difference is said.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.dictionary_difference import DictionaryDifference, differences, without_values
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.concise_dcf import SUFFIX as CONCISE_SUFFIX
from dvtcli.domain.object_dictionary import Commissioning
from dvtcli.domain.several import join_some, plural
from dvtcli.errors import UsageError
from dvtcli.files.carried_over import not_held
from dvtcli.files.device_file import (
    DEVICE_SUFFIXES,
    VALUE_SUFFIXES,
    XDD_SUFFIXES,
    device_file_bytes,
    parse_device_file,
    read_device_file,
)
from dvtcli.files.file_info import NO_DATE, file_info
from dvtcli.operations.results.files import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.files.xdd.xdd_reader import XddFile
    from dvtcli.operations.session.session import Session

#: What the parts of a dictionary are called in a message.
_WORDS = {
    "value": "ParameterValue (actualValue)", "default": "DefaultValue", "low": "LowLimit", "high": "HighLimit",
    "name": "name", "access": "access type", "pdo_mapping": "PDO mapping", "unit": "unit", "denotation": "denotation",
    "object_flags": "ObjFlags", "object": "object", "node_id": "node-ID", "bit_rate_kbit": "bit rate of the bus",
}  # fmt: skip
_NO_DATE_NOTE = f"{{}} does not say when it was made: {NO_DATE} stands there, since an XDD must have a date"
#: What belongs to one node, and not to every device of its kind.
_OF_ONE_NODE = {"value", "denotation", "node_id", *(field.name for field in fields(Commissioning))}
#: What every file says about itself that is written anew.
_OF_EVERY_FILE = (("FileRevision", "0"), ("FileRevision", "0x0"), ("EDSVersion", "4.0"))
#: Said with what they belong to.
_BESIDE = ("value_relative", "default_relative", "low_relative", "high_relative")


def convert_device_file(session: Session, file: str, target: str) -> Facts:
    """Write what *file* says of a device to *target*, in the format that its name ends in, and say what it cannot hold.

    An EDS or XDD holds no values of one node. Asks before it overwrites. UsageError where *target* has another suffix,
    or a file cannot be read or written; InputFileError where *file* is none.
    """
    path = place_of(target, "NAME.xdd")
    suffix = path.suffix.lower()
    if suffix not in DEVICE_SUFFIXES:
        raise UsageError(f"{target}: what format is that?", hint=f"a name that ends in {', '.join(DEVICE_SUFFIXES)}")
    read = _read(file)
    wanted = read.dictionary if suffix in VALUE_SUFFIXES else without_values(read.dictionary)
    said = file_info(read)
    data = device_file_bytes(wanted, path.name, f"made from {Path(file).name}", None, said)
    again = parse_device_file(data, path.name)
    losses = [*lost(read.dictionary, again.dictionary, suffix), *_unsaid(said, file_info(again)), *not_held(read)]
    notes = [_NO_DATE_NOTE.format(file)] if suffix in XDD_SUFFIXES and "CreationDate" not in said else []
    ask_before_overwriting(session, path)
    make_file(session, path, data)
    return _answer(file, target, len(again.dictionary), losses, notes)


def _read(file: str) -> EdsFile | XddFile:
    if file.lower().endswith(CONCISE_SUFFIX):
        raise UsageError(
            f"{file} is a concise DCF: what a manager (0x1F22) writes to one node, and no description of a device",
            place=file,
            hint=Hint(Action.SHOW_EDS, {"file": file}, "shows it")
            + Hint(Action.WRITE, {"object": "1F22:5", "value": f"@{file}"}, "gives node 5's to the manager"),
        )
    try:
        return read_device_file(Path(file))
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed


def _unsaid(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """What the file said about itself *before*, and does not say *after*."""
    gone = [item for item in before.items() if after.get(item[0]) != item[1] and item not in _OF_EVERY_FILE]
    return [f"FileInfo: {', '.join(f'{key} ({value})' for key, value in gone)}"] if gone else []


def lost(before: ObjectDictionary, after: ObjectDictionary, suffix: str) -> list[str]:
    """What *after*, a file that ends in *suffix*, does not say as *before* did, each kind once."""
    found: dict[str, list[DictionaryDifference]] = {}
    for difference in differences(before, after):
        if difference.what not in _BESIDE:
            found.setdefault(difference.what, []).append(difference)
    return [_said(what, ones, suffix) for what, ones in found.items()]


def _said(what: str, ones: list[DictionaryDifference], suffix: str) -> str:
    places = join_some(difference.place or "the device" for difference in ones)
    named = _WORDS.get(what, what.replace("_", " "))
    why = ""
    if suffix not in VALUE_SUFFIXES and what in _OF_ONE_NODE:
        other = ".xdc" if suffix in XDD_SUFFIXES else ".dcf"
        why = f": it is of one node, {other} holds it"
    return f"{named} of {places}{why}"


def _answer(file: str, target: str, objects: int, losses: list[str], notes: list[str]) -> Facts:
    count = plural(objects, "object")
    said = [f"{target}: {count} of {file}, read back" + ("" if losses else "; nothing is lost")]
    said += (f"warning: not carried over: {loss}" for loss in losses)
    said += (f"note: {note}" for note in notes)
    rows = (("file", file), ("to", target), ("objects", objects), ("losses", losses))
    return Facts("eds-converted", rows, tuple(said))
