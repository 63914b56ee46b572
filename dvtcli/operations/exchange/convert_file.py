"""Convert a file to the format of the target's suffix. Needs no bus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.concise_dcf import SUFFIX as CONCISE_SUFFIX
from dvtcli.domain.object_dictionary import Commissioning
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import UsageError
from dvtcli.files.carried_over import (
    DictionaryDifference,
    differences,
    kept,
    not_held,
    without_scalings,
    without_values,
)
from dvtcli.files.dbc import SUFFIX
from dvtcli.files.device_file import (
    DEVICE_SUFFIXES,
    VALUE_SUFFIXES,
    XDD_SUFFIXES,
    device_file_bytes,
    parse_device_file,
    read_device_file,
)
from dvtcli.files.file_info import NO_DATE, file_info
from dvtcli.operations.exchange.export_dbc import DbcOptions, convert_to_dbc, recording_to_dbc
from dvtcli.operations.exchange.export_network import SUFFIXES as NETWORK_SUFFIXES
from dvtcli.operations.results.facts import Facts
from dvtcli.operations.session.save_script import ask_before_overwriting, make_file, place_of
from dvtcli.operations.session.simulated_nodes import file_or_family, must_have_modules

if TYPE_CHECKING:
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.files.eds.writer import KeptText
    from dvtcli.files.xdd.xdd_reader import XddFile
    from dvtcli.operations.session.session import Session
    from dvtcli.operations.user.session_user import SessionUser


class ConversionFormat:
    """A format, chosen by its *suffixes*."""

    suffixes: ClassVar[tuple[str, ...]]
    #: the alternative to choosing a node of a network file; None if it is made of a node
    instead_of_a_node: ClassVar[Hint | str | None] = Hint(Action.CONVERT, {"target": "NAME.cdcf", "of": "NODE"})
    #: whether it can be wanted otherwise than by default, as a DBC file can
    has_options: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "suffixes" not in vars(cls):
            raise TypeError(f'{cls.__module__}: {cls.__name__} needs a line such as suffixes = (".xdd", ".xdc")')

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write the *wanted* file, asking before overwriting.

        Losses are in the result's row `losses`, or `left_out`.
        """
        raise NotImplementedError


class DbcFormat(ConversionFormat):
    """The enabled PDOs of all nodes."""

    suffixes = (SUFFIX,)
    instead_of_a_node = "a DBC file has all nodes of a network file"
    has_options = True

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it by `convert_to_dbc` or `recording_to_dbc`."""
        to_dbc = recording_to_dbc if _is_recording(wanted.source) else convert_to_dbc
        return to_dbc(session, wanted.source, wanted.target, wanted.dbc)


def _is_recording(file: str) -> bool:
    """Tell whether *file* has the suffix of a recording of frames."""
    suffix = Path(file).suffix.lower()
    if suffix in NETWORK_SUFFIXES:
        return False
    from dvtcli.files.recordings.formats import formats

    return suffix in formats()


#: Names for parts of a dictionary in a message.
_WORDS = {
    "value": "ParameterValue (actualValue)", "default": "DefaultValue", "low": "LowLimit", "high": "HighLimit",
    "name": "name", "access": "access type", "pdo_mapping": "PDO mapping", "unit": "unit", "denotation": "denotation",
    "object_flags": "ObjFlags", "object": "object", "node_id": "node-ID", "bit_rate_kbit": "bit rate of the bus",
}  # fmt: skip
_NO_DATE_NOTE = f"{{}} has no date of creation: {NO_DATE} is written instead, since an XDD must have a date"
#: Data of a single node, not of every device of its kind.
_OF_ONE_NODE = {"value", "denotation", "node_id", *(field.name for field in fields(Commissioning))}
#: File information that is always written anew.
_OF_EVERY_FILE = (("FileRevision", "0"), ("FileRevision", "0x0"), ("EDSVersion", "4.0"))
#: Reported with their objects.
_BESIDE = ("value_relative", "default_relative", "low_relative", "high_relative")


def convert_device_file(session: SessionUser, file: str, target: str, *, plain: bool = False) -> Facts:
    """Convert the device file or simulated family *file* to the format of *target*'s suffix, and list what is lost.

    An EDS or XDD has no values of a node. A *plain* EDS or DCF has only the keys and sections that every reader takes:
    no units, modules and safety keys. Asks before overwriting. Raises UsageError if *target* has another suffix, or
    a file cannot be read or written; InputFileError if *file* is invalid.
    """
    path = place_of(target, "NAME.xdd")
    suffix = path.suffix.lower()
    if suffix not in DEVICE_SUFFIXES:
        raise UsageError(
            f"{target}: unknown format", hint=f"a name that ends in {', '.join((*DEVICE_SUFFIXES, '.cdcf'))}"
        )
    if plain and suffix in XDD_SUFFIXES:
        raise _not_plain(target)
    read = _read(file, session.options.chosen_modules)
    wanted = read.dictionary if suffix in VALUE_SUFFIXES else without_values(read.dictionary)
    wanted = without_scalings(wanted) if plain else wanted
    said = file_info(read)
    keeps = None if plain else _kept(read, suffix)
    data = device_file_bytes(wanted, path.name, f"made from {Path(file).name}", None, said, keeps)
    again = parse_device_file(data, path.name)
    losses = [
        *lost(read.dictionary, again.dictionary, suffix),
        *_unsaid(said, file_info(again)),
        *not_held(read, keeps),
    ]
    notes = [_NO_DATE_NOTE.format(file)] if suffix in XDD_SUFFIXES and "CreationDate" not in said else []
    ask_before_overwriting(session, path)
    make_file(session, path, data)
    return _answer(file, target, len(again.dictionary), losses, notes)


def _not_plain(target: str) -> UsageError:
    hint = Hint(Action.CONVERT, {"file": "drive.eds", "target": "plain.eds", "plain": True})
    return UsageError(f"{target} is not an EDS or DCF; only these can be plain", given={"plain": None}, hint=hint)


def _kept(read: EdsFile | XddFile, suffix: str) -> KeptText | None:
    """Return what a file with *suffix* keeps of *read* beside its dictionary; None for an XDD or of an XDD."""
    from dvtcli.files.eds.reader import EdsFile

    if suffix in XDD_SUFFIXES or not isinstance(read, EdsFile):
        return None
    return kept(read, of_a_node=suffix in VALUE_SUFFIXES)


def _read(file: str, modules: tuple[int, ...] | None) -> EdsFile | XddFile:
    if file.lower().endswith(CONCISE_SUFFIX):
        raise UsageError(
            f"{file} is a concise DCF: values that a manager (0x1F22) writes to one node, not a description of a "
            f"device",
            place=file,
            hint=Hint(Action.SHOW_EDS, {"file": file}, "shows it")
            + Hint(Action.WRITE, {"object": "1F22:5", "value": f"@{file}"}, "writes that of node 5 to the manager"),
        )

    try:
        read = read_device_file(file_or_family(file), modules)
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    if modules is not None:
        must_have_modules(read.dictionary, modules)
    return read


def _unsaid(before: Mapping[str, str], after: Mapping[str, str]) -> list[str]:
    """List file information of *before* missing in *after*."""
    gone = [item for item in before.items() if after.get(item[0]) != item[1] and item not in _OF_EVERY_FILE]
    return [f"FileInfo: {', '.join(f'{key} ({value})' for key, value in gone)}"] if gone else []


def lost(before: ObjectDictionary, after: ObjectDictionary, suffix: str) -> list[str]:
    """List, once per kind, what *after*, a file with *suffix*, loses from *before*."""
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


class DeviceFileFormat(ConversionFormat):
    """EDS and XDD, DCF and XDC."""

    suffixes = DEVICE_SUFFIXES

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it by `convert_device_file`; raises UsageError for another suffix."""
        return convert_device_file(session, wanted.source, wanted.target, plain=wanted.plain)


class ConciseDcfFormat(ConversionFormat):
    """A concise DCF (0x1F22) of a node."""

    suffixes = (CONCISE_SUFFIX,)
    instead_of_a_node = None

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write it by `convert_network`."""
        from dvtcli.operations.network.concise_network import convert_network

        return convert_network(session, wanted.source, wanted.target, wanted.node)


@cache
def conversion_formats() -> Mapping[str, ConversionFormat]:
    """Map suffixes to formats."""
    formats: tuple[ConversionFormat, ...] = (ConciseDcfFormat(), DbcFormat(), DeviceFileFormat())
    return {suffix: format_ for format_ in formats for suffix in format_.suffixes}


def convert_file(
    session: Session,
    file: str,
    target: str,
    node: str | int | None = None,
    options: DbcOptions | None = None,
    *,
    plain: bool = False,
) -> Facts:
    """Convert *file* to the format of *target*'s suffix, and list what is lost.

    An EDS or XDD has no values of a node. A .cdcf is of *node* of a network file, a .dbc of all nodes of a network file
    or recording, by *options*. *plain*: an EDS or DCF for every reader. Asks before overwriting. Raises UsageError if
    *target* has another suffix, or a file cannot be read or written; InputFileError if *file* is invalid.
    """
    kind = _format_of(target)
    if options and not kind.has_options:
        raise UsageError(
            f"{target} is not a DBC file; the option is for DBC files only",
            given=dict.fromkeys(options.named),
            hint=Hint(Action.CONVERT, {"file": "net.yaml", "target": "net.dbc", "services": "emcy"}),
        )
    if node is not None and kind.instead_of_a_node:
        raise UsageError(
            "a node of a network file is chosen for a concise DCF", given={"node": node}, hint=kind.instead_of_a_node
        )
    if plain and not isinstance(kind, DeviceFileFormat):
        raise _not_plain(target)
    return kind.write(session, Converted(file, target, node, options or DbcOptions(), plain))


def _format_of(target: str) -> ConversionFormat:
    """Return the format of *target*; for an unknown suffix the device file format, which lists all suffixes."""
    known, name = conversion_formats(), target.lower()
    return next((conversion for suffix, conversion in known.items() if name.endswith(suffix)), known[".eds"])


@dataclass(frozen=True, slots=True)
class Converted:
    """A request: *source* to *target*; the *node* of a network file, by name or node-ID; *dbc* options; *plain*."""

    source: str
    target: str
    node: str | int | None = None
    dbc: DbcOptions = field(default_factory=DbcOptions)
    plain: bool = False
