"""Write users' files: whole, readable and read back by the reader of their kind, or not at all; follows links."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from stat import S_IMODE

from dvtcli.device.change.private_file import put_in_place
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.files.device_file import DEVICE_SUFFIXES, must_be_whole, read_device_file


def write_whole(path: Path, data: bytes, read_back: ReadBack | None = None) -> None:
    """Write a file whole or not at all, readable for others; raises UsageError if impossible.

    *read_back* reads the new file before it gets its name: after an InputFileError the old file stays. A link stays,
    and its target is written. Pipes and other special files are written directly.
    """
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
        else:
            _replace(path, Path(os.path.realpath(path)), data, read_back)
    except OSError as failed:
        raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed


def _replace(path: Path, target: Path, data: bytes, read_back: ReadBack | None) -> None:
    made = target.parent / f".{os.urandom(8).hex()}.new{path.suffix}"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        with os.fdopen(os.open(made, flags, _mode(target)), "wb") as file:
            file.write(data)
        if read_back is not None:
            _read_back(path, made, read_back)
        put_in_place(made, target)
    finally:
        made.unlink(missing_ok=True)


def _read_back(path: Path, made: Path, read_back: ReadBack) -> None:
    try:
        read_back(made)
    except DvtcliError as failed:
        said = ": ".join(filter(None, (failed.text, failed.why)))
        why = said.replace(str(made), str(path)).replace(made.name, path.name)
        unlike = InputFileError(
            f"{path} is not written: its content cannot be read back",
            place=str(path),
            why=why,
            hint=Hint(Action.CHECK_EDS, why="its source may be at fault: {} checks a device's file"),
        )
        unlike.outcome = "the earlier file of that name stays"
        raise unlike from failed


def _mode(target: Path) -> int:
    """Return the mode of the file: its own, or the umask's for a new file."""
    try:
        return S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return 0o644


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
    from dvtcli.domain.gateway_requests import parse_request

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
