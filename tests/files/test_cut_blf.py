"""A BLF container that ends too early: its frames are not read as if they were all."""

from __future__ import annotations

import struct
from pathlib import Path

import can
import pytest
from can.io.blf import FILE_HEADER_STRUCT

from dvtcli.errors import InputFileError
from dvtcli.files.recordings.recording_file import read_recorded

_OBJECT = struct.Struct("<4sHHLL")


@pytest.mark.parametrize("missing", [1, 10, 200])
def test_a_container_that_ends_early_is_damage(missing: int, tmp_path: Path) -> None:
    path = tmp_path / "x.blf"
    with can.BLFWriter(path) as writer:
        for number in range(500):
            writer.on_message_received(
                can.Message(1.7e9 + number / 1000, 0x181, data=struct.pack("<Q", number * 7919), is_extended_id=False)
            )
    assert len(list(read_recorded(path))) == 500
    whole = path.read_bytes()
    at = whole.index(b"LOBJ")
    signature, head, version, size, kind = _OBJECT.unpack_from(whole, at)
    cut = whole[:at] + _OBJECT.pack(signature, head, version, size - missing, kind)
    cut += whole[at + _OBJECT.size : at + size - missing]
    cut += bytes((size - missing) % 4)
    header = [len(cut) if value == len(whole) else value for value in FILE_HEADER_STRUCT.unpack_from(whole)]
    path.write_bytes(FILE_HEADER_STRUCT.pack(*header) + cut[FILE_HEADER_STRUCT.size :])
    with pytest.raises(InputFileError):
        list(read_recorded(path))
