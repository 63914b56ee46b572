"""The one place where a file that describes a device is told from another: EDS and DCF from XDD and XDC.

By its first bytes; a name that ends in .xdd or .xdc is one whatever is in it. Does not know what is in the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import InputFileError
from dvtcli.files.input_file import read_input_head

if TYPE_CHECKING:
    from collections.abc import Mapping
    from datetime import datetime

    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.files.xdd.xdd_reader import XddFile

#: How the names of EDS and DCF files end, and those of XDD and XDC files; of each the second has a node's own values.
EDS_SUFFIXES = (".eds", ".dcf")
XDD_SUFFIXES = (".xdd", ".xdc")
DEVICE_SUFFIXES = EDS_SUFFIXES + XDD_SUFFIXES
#: Those with a node's own values.
VALUE_SUFFIXES = (".dcf", ".xdc")
_LOOKED_AT = 64
_MARKS = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"


def read_device_file(path: Path) -> EdsFile | XddFile:
    """Read the EDS, DCF, XDD or XDC file at *path*.

    InputFileError, with the line, where it is none of them; OSError where it cannot be read.
    """
    if _is_xml(path):
        from dvtcli.files.xdd.xdd_reader import read_xdd

        return read_xdd(path)
    from dvtcli.files.eds.reader import read_eds

    return read_eds(path)


def parse_device_file(data: bytes, source: str) -> EdsFile | XddFile:
    """Read the bytes of such a file; *source* is its name, also for messages."""
    if _looks_like_xml(data[:_LOOKED_AT], source):
        from dvtcli.files.xdd.xdd_reader import parse_xdd

        return parse_xdd(data, source)
    from dvtcli.files.eds.reader import parse_eds

    return parse_eds(data, source)


def must_describe(dictionary: ObjectDictionary) -> None:
    """InputFileError where the file of *dictionary* describes no object: nothing could be read by it."""
    if not len(dictionary):
        source = dictionary.source
        hint = Hint(Action.CHECK_EDS, {"file": source}, "is it cut short? {} says more") + Hint(
            Action.REMOVE_EDS, why="where it is in the library, {} takes it out"
        )
        raise InputFileError(f"{source} describes no object", place=source, hint=hint)


def must_be_whole(read: EdsFile | XddFile) -> None:
    """InputFileError where *read* describes no object, or ends before the last one that its lists name."""
    must_describe(read.dictionary)
    must_not_be_cut(read)


def must_not_be_cut(read: EdsFile | XddFile) -> None:
    """InputFileError where *read* ends before the last object that its lists name: what is missing was not left out."""
    from dvtcli.files.eds.reader import EdsFile

    if isinstance(read, EdsFile) and (lacks := read.lacks_to_its_end):
        source = read.dictionary.source
        hint = Hint(Action.CHECK_EDS, {"file": source}, "get the whole file; {} names each of them")
        raise InputFileError(f"{source} is cut short: {lacks}", place=source, hint=hint)


def device_file_bytes(
    dictionary: ObjectDictionary,
    name: str,
    description: str,
    made: datetime | None,
    said: Mapping[str, str] | None = None,
) -> bytes:
    """*dictionary* as a file called *name*, in the format that the name ends in; *description* is one line about it.

    *said* is what the file that it is made of says about itself, by the keys of FileInfo, and what stays so; without
    *made* nothing else says a date, so that the same gives the same bytes.
    """
    if name.lower().endswith(XDD_SUFFIXES):
        from dvtcli.files.xdd.xdd_writer import xdd_bytes

        return xdd_bytes(dictionary, name, made, said)
    from dvtcli.files.eds.writer import eds_bytes, eds_text

    return eds_bytes(eds_text(dictionary, name, description, made, said))


def is_xml(data: bytes, name: str) -> bool:
    """Whether *data*, a file called *name*, is an XDD or XDC rather than an EDS or DCF."""
    return _looks_like_xml(data[:_LOOKED_AT], name)


def _is_xml(path: Path) -> bool:
    return _looks_like_xml(read_input_head(path, _LOOKED_AT), path.name)


def _looks_like_xml(first: bytes, name: str) -> bool:
    """Whether a file called *name* that begins with *first* is XML, in whatever encoding."""
    return first.lstrip(_MARKS)[:1] == b"<" or name.lower().endswith(XDD_SUFFIXES)
