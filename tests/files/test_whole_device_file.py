"""A whole device as JSON lines: what was written is read, and nothing else is taken for it."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.errors import InputFileError
from dvtcli.files.whole_device_file import KeptDevice, KeptObject, read_whole_device, whole_device_text

IDENTITY = {"vendor": 1, "product": 2, "revision": 3, "serial": None}
objects = st.dictionaries(
    st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFF)),
    st.builds(KeptObject, st.binary(max_size=20), st.just(""), st.sampled_from(["", "u16", "vs"]))
    | st.builds(KeptObject, st.none(), st.text(min_size=1), st.just("")),
    max_size=8,
)


@given(st.integers(1, 127), objects, st.text())
def test_what_was_kept_is_read(tmp_path_factory: pytest.TempPathFactory, node: int, held: dict, eds: str) -> None:
    file = tmp_path_factory.getbasetemp() / "whole.jsonl"
    kept = KeptDevice(node, IDENTITY, "2026-11-23T00:00:00.000000Z", held, eds)
    file.write_text(whole_device_text(kept), "utf-8")
    assert read_whole_device(file) == kept


HEAD = (
    '{"schema": "dvtcli.whole-device/1", "node": 5, "identity": {"vendor": 1}, "made": "", "eds": null, "objects": 1}'
)


@pytest.mark.parametrize(
    ("text", "place", "why"),
    [
        ("", "1", "its first line is not dvtcli.whole-device/1"),
        ('{"schema": "dvtcli.pdo/1"}', "1", "its first line is not dvtcli.whole-device/1"),
        ("[FileInfo]", "1:2", "not JSON: Expecting value"),
        (HEAD, "1", "it has 0 objects, and its first line says 1: it may be truncated"),
        (HEAD + '\n{"object": "1017", "raw": "00"}', "2", 'no "object"'),
        (HEAD + '\n{"object": "1017:00", "raw": "0"}', "2", '"raw" is not bytes'),
        (HEAD + '\n{"object": "1017:00", "raw": 7}', "2", '"raw" is not bytes'),
        (HEAD + "\n[]", "2", "a line is an object of JSON"),
        (
            HEAD.replace('"node": 5', '"node": 0') + '\n{"object": "1017:00", "raw": "00"}',
            "1",
            "it has no node-ID or no identity",
        ),
        (HEAD + '\n{"object": "1017:00", "ra', "2:23", "not JSON: Unterminated string"),
        (HEAD + '\n\n{"object": "1017:00"', "3:21", "not JSON: Expecting ',' delimiter"),
    ],
)
def test_what_is_no_such_file_is_said_with_its_line(tmp_path: Path, text: str, place: str, why: str) -> None:
    file = tmp_path / "a.jsonl"
    file.write_text(text, "utf-8")
    with pytest.raises(InputFileError) as wrong:
        read_whole_device(file)
    assert wrong.value.place == f"{file}:{place}"
    assert (wrong.value.why or "").startswith(why)


@given(st.binary(max_size=200))
def test_whatever_the_bytes(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    file = tmp_path_factory.getbasetemp() / "any.jsonl"
    file.write_bytes(data)
    with pytest.raises(InputFileError):
        read_whole_device(file)
