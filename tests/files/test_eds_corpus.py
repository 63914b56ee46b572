"""Real files of a folder given with `--eds-corpus DIR`; none of them belongs to this project."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import PdoMappingEntry
from dvtcli.files.eds.reader import EdsFile, read_eds
from tests.real_files import real_files


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    paths = real_files(metafunc.config)
    metafunc.parametrize("path", paths, ids=[path.name for path in paths])


def headers(path: Path) -> int:
    """Lines that begin with a bracket, counted without the reader."""
    return sum(line.lstrip().startswith(b"[") for line in path.read_bytes().replace(b"\r", b"\n").split(b"\n"))


def mappings(dictionary: ObjectDictionary) -> list[PdoMappingEntry]:
    """What the file's PDOs map at power-on."""
    held = []
    for index in dictionary:
        if 0x1600 <= index <= 0x17FF or 0x1A00 <= index <= 0x1BFF:
            count = dictionary.entry(index, 0)
            mapped = (count.initial(1) or b"\0")[0] if count else 0
            entries = [dictionary.entry(index, sub_index) for sub_index in range(1, min(mapped, 64) + 1)]
            held += [entry.initial(1) or b"" for entry in entries if entry]
    return [PdoMappingEntry.from_raw(int.from_bytes(data, "little")) for data in held if any(data)]


def test_nothing_is_dropped_in_silence(path: Path) -> None:
    file = read_eds(path)
    reported = [finding for finding in file.findings if finding.rule == "section-not-understood"]
    assert file.sections == headers(path) == file.understood + len(reported)
    assert all(finding.line >= 1 for finding in file.findings)
    assert all(entry.line for entry in file.dictionary.entries())


def test_pdos_are_found_and_map_objects_of_the_file(path: Path) -> None:
    dictionary = read_eds(path).dictionary
    described = [i for i in dictionary if 0x1400 <= i <= 0x1BFF]
    assert described
    assert all(dictionary[index].entries for index in described)
    for mapped in mappings(dictionary):
        assert 1 <= mapped.bits <= 64
        assert mapped.index < 0x20 or dictionary.entry(mapped.index, mapped.sub_index), f"{mapped} is not in the file"


def test_values_fit_their_types(path: Path) -> None:
    file: EdsFile = read_eds(path)
    for entry in file.dictionary.entries():
        for data in (entry.default, entry.value):
            if data is not None:
                assert entry.data_type is not None
                entry.data_type.decode(data)
    assert any(entry.default is not None for entry in file.dictionary.entries())
