"""Read a written file back by the reader of its kind, before it counts as written."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES

#: Reads a file like its later users; raises DvtcliError if malformed.
ReadBack = Callable[[Path], object]


def reader_of(path: Path) -> ReadBack | None:
    """Return the reader for the name of *path*; None if dvtcli has none."""
    suffix = path.suffix.lower()
    if suffix in DEVICE_SUFFIXES:
        return _read_device
    return _READERS.get(suffix)


def _read_device(path: Path) -> None:
    """Read an EDS, DCF, XDD or XDC with all objects in its lists."""
    from dvtcli.files.device_file import must_be_whole, read_device_file

    must_be_whole(read_device_file(path))


def _read_network(path: Path) -> None:
    from dvtcli.files.network.read_network import read_network_file

    read_network_file(path)


def _read_dbc(path: Path) -> None:
    from dvtcli.files.dbc import read_dbc

    with suppress(UsageError):  # what reads it is an extra, which is not installed
        read_dbc(str(path))


def _read_concise(path: Path) -> None:
    from dvtcli.domain.network.concise_dcf import concise_entries

    try:
        concise_entries(path.read_bytes())
    except ValueError as wrong:
        raise InputFileError(str(wrong), place=str(path)) from wrong


def _read_nodelist(path: Path) -> None:
    from dvtcli.files.nodelist import read_nodelist

    read_nodelist(path.read_bytes(), path.name)


def _read_gateway(path: Path) -> None:
    """Read lines of CiA 309-3."""
    from dvtcli.domain.gateway.requests import parse_request

    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        try:
            parse_request(line)
        except ValueError as wrong:
            raise InputFileError(f"{path.name}:{number}: {wrong}", place=f"{path}:{number}") from wrong


def _read_drawing(path: Path) -> None:
    from xml.etree.ElementTree import ParseError, parse

    try:
        parse(path)  # noqa: S314 - what was written just now
    except ParseError as wrong:
        raise InputFileError(f"{path.name}: {wrong}", place=str(path)) from wrong


_READERS: dict[str, ReadBack] = {
    ".yaml": _read_network,
    ".yml": _read_network,
    ".dbc": _read_dbc,
    ".cdcf": _read_concise,
    ".cpj": _read_nodelist,
    ".309": _read_gateway,
    ".svg": _read_drawing,
}
