"""Read program files: `.bin` unchanged, `.hex` in Intel's form."""

from __future__ import annotations

from pathlib import Path

from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.extras import extra
from dvtcli.files.input_file import read_input

SUFFIXES = (".bin", ".hex")
#: maximum size of a program (bytes)
MOST_BYTES = 16 << 20
#: erased flash memory, for gaps in a file
_ERASED = 0xFF


def read_program(file: str) -> bytes:
    """Read the program in *file*; gaps of a .hex file are 0xFF.

    Raises UsageError for another suffix or an unreadable file, InputFileError if empty, damaged or too large.
    """
    suffix = Path(file).suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(f"{file}: a program file ends in .bin or .hex", place=file)
    try:
        data = read_input(file, 4 * MOST_BYTES, "program")
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
    program = data if suffix == ".bin" else _of_hex(file, data)
    if not program:
        raise InputFileError(f"{file} has no program", place=file)
    if len(program) > MOST_BYTES:
        raise InputFileError(f"{file}: a program of more than {MOST_BYTES:,} bytes", place=file)
    return program


def _of_hex(file: str, data: bytes) -> bytes:
    package = extra("intelhex", "hex", "reading a .hex file")
    import io

    read = package.IntelHex()
    try:
        read.loadhex(io.StringIO(data.decode("ascii")))
    except (package.IntelHexError, UnicodeDecodeError) as wrong:
        raise InputFileError(f"{file} is not an Intel HEX file: {wrong}", place=file) from wrong
    first, last = read.minaddr(), read.maxaddr()
    if first is None or last is None:
        return b""
    if last - first >= MOST_BYTES:
        text = f"{file}: from 0x{first:X} to 0x{last:X} are more than {MOST_BYTES:,} bytes"
        raise InputFileError(text, place=file)
    read.padding = _ERASED
    return bytes(read.tobinarray(start=first, end=last))
