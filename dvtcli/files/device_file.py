"""Read files that describe a device: EDS, DCF, XDD and XDC. Only this module tells them apart.

The first bytes decide, after a suffix .xdd or .xdc; the suffix alone, before a file is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import InputFileError
from dvtcli.files.eds.reader import EdsFile, parse_eds, read_eds
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from collections.abc import Mapping
    from datetime import datetime

    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.files.eds.write_dcf import DcfText
    from dvtcli.files.eds.writer import KeptText
    from dvtcli.files.xdd.xdd_reader import XddFile

#: How the names of EDS and DCF files end, and those of XDD and XDC files; of each the second has a node's own values.
EDS_SUFFIXES = (".eds", ".dcf")
XDD_SUFFIXES = (".xdd", ".xdc")
DEVICE_SUFFIXES = EDS_SUFFIXES + XDD_SUFFIXES
#: Suffixes of files with a node's own values.
VALUE_SUFFIXES = (".dcf", ".xdc")
_LOOKED_AT = 64
_MARKS = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"


def read_device_file(path: Path, modules: Sequence[int] | None = None) -> EdsFile | XddFile:
    """Read the EDS, DCF, XDD or XDC file at *path*.

    An EDS or DCF of a modular device is read with *modules* connected, by their numbers in the file; None: as it says.
    Raises InputFileError, with the line, for any other file; OSError if the file cannot be read.
    """
    if _is_xml(path):
        from dvtcli.files.xdd.xdd_reader import read_xdd

        return read_xdd(path)

    return read_eds(path, modules)


def parse_device_file(data: bytes, source: str) -> EdsFile | XddFile:
    """Parse the bytes of an EDS, DCF, XDD or XDC file; *source* is its name, also for messages."""
    if _looks_like_xml(data[:_LOOKED_AT], source):
        from dvtcli.files.xdd.xdd_reader import parse_xdd

        return parse_xdd(data, source)

    return parse_eds(data, source)


def must_describe(dictionary: ObjectDictionary) -> None:
    """Raise InputFileError if *dictionary* has no object."""
    if not len(dictionary):
        source = dictionary.source
        hint = Hint(Action.CHECK_EDS, {"file": source}, "the file may be truncated; {} shows more") + Hint(
            Action.REMOVE_EDS, why="if it is in the library, {} takes it out"
        )
        raise InputFileError(f"{source} describes no object", place=source, hint=hint)


def must_be_whole(read: EdsFile | XddFile) -> None:
    """Raise InputFileError if *read* has no object, or ends before the last object in its lists."""
    must_describe(read.dictionary)
    must_not_be_cut(read)


def lacks_to_its_end(read: EdsFile | XddFile) -> str:
    """Describe the missing objects of a file that ends before the last object in its lists; empty for a whole file."""
    return read.lacks_to_its_end if isinstance(read, EdsFile) else ""


def must_not_be_cut(read: EdsFile | XddFile) -> None:
    """Raise InputFileError if *read* ends before the last object in its lists: the file is cut short."""
    if lacks := lacks_to_its_end(read):
        source = read.dictionary.source
        hint = Hint(Action.CHECK_EDS, {"file": source}, "get the complete file; {} lists them")
        raise InputFileError(f"{source} is cut short: {lacks}", place=source, hint=hint)


def device_file_bytes(
    dictionary: ObjectDictionary,
    name: str,
    description: str,
    made: datetime | None,
    said: Mapping[str, str] | None = None,
    keeps: KeptText | None = None,
) -> bytes:
    """Write *dictionary* as a file *name*, in the format of the suffix; *description* is a line about it.

    *said* are the original file's statements about itself, by the keys of FileInfo, to keep; *keeps* is what an EDS has
    beside its dictionary. Without *made* the file has no new date, so that equal input gives equal bytes.
    """
    if name.lower().endswith(XDD_SUFFIXES):
        from dvtcli.files.xdd.xdd_writer import xdd_bytes

        return xdd_bytes(dictionary, name, made, said)
    from dvtcli.files.eds.writer import eds_bytes, eds_text

    return eds_bytes(eds_text(dictionary, name, description, made, said, keeps))


def change_values(data: bytes, source: str, values: Mapping[tuple[int, int], bytes], node_id: int) -> DcfText:
    """Return the DCF or XDC *data* (named *source*) with *values* of *node_id*; every other byte of the file stays.

    Raises InputFileError if *data* is neither, or no value can be written.
    """
    if is_xml(data, source):
        from dvtcli.files.xdd.xdd_writer import change_values as change_xdc

        return change_xdc(data, source, values, node_id)
    from dvtcli.files.eds.write_dcf import change_values as change_dcf

    return change_dcf(data, source, values, node_id)


def is_xml(data: bytes, name: str) -> bool:
    """Whether *data*, a file called *name*, is an XDD or XDC rather than an EDS or DCF."""
    return _looks_like_xml(data[:_LOOKED_AT], name)


def _is_xml(path: Path) -> bool:
    return _looks_like_xml(read_input_head(path, _LOOKED_AT), path.name)


def _looks_like_xml(first: bytes, name: str) -> bool:
    """Whether a file called *name* that begins with *first* is XML, in whatever encoding."""
    return first.lstrip(_MARKS)[:1] == b"<" or name.lower().endswith(XDD_SUFFIXES)


def connected_file(path: Path, modules: Sequence[int]) -> bytes:
    """Return the EDS or DCF at *path* with *modules* connected, and the sections of their objects."""
    from dvtcli.files.carried_over import kept
    from dvtcli.files.file_info import file_info

    read = read_device_file(path, modules)
    keeps = kept(read, of_a_node=True) if isinstance(read, EdsFile) else None
    return device_file_bytes(read.dictionary, path.name, f"made from {path.name}", None, file_info(read), keeps)


_HOLDS, _DESCRIBES = (".dcf", ".xdc", ".jsonl"), (".eds", ".xdd")


def is_about_device(file: str) -> bool:
    """Tell whether *file* is about a device, and not about a network."""
    return file.lower().endswith((*_HOLDS, *_DESCRIBES))


def holds_values(file: str) -> bool:
    """Tell whether *file* has a device's values: a DCF, an XDC or a backup's JSON lines."""
    return file.lower().endswith(_HOLDS)
