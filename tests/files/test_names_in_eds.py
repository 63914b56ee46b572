"""A name that is looked for in the text of an EDS means the same objects as one looked for among all objects."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.object_dictionary import ObjectDictionary, normalised
from dvtcli.files.eds.reader import parse_eds
from tests.files.test_eds_any import SAMPLE

FAMILIES = Path(__file__).parents[2] / "dvtcli" / "families"
WORDS = ("Status", "word", "Kanal", "größe", "BEEF", "K", "1", "a.b", "NrOfObjects", "Face", "İx")
NAMES = st.lists(st.sampled_from(WORDS), min_size=0, max_size=4).map(" ".join)


def without_texts(dictionary: ObjectDictionary) -> ObjectDictionary:
    """The same objects, of which none tells where the file names it."""
    return ObjectDictionary(dict(dictionary), dictionary.info, dictionary.source)


def every_name(dictionary: ObjectDictionary, indices: Iterable[int]) -> set[str]:
    names = {dictionary[index].name for index in indices}
    for entry in (entry for index in indices for entry in dictionary[index].entries.values()):
        names |= {entry.name, entry.denotation, dictionary.display_name(entry.index, entry.sub_index)}
        names.add(f"{dictionary[entry.index].name}.{entry.name}")
    return names | {normalised(name) for name in names} | {"no such object"}


def must_agree(data: bytes, modules: tuple[int, ...] | None = None, only: int | None = None) -> int:
    """Look for each name of all objects, or *only* of that one, in both ways; how many names there are."""
    own = parse_eds(data, "a.eds", modules).dictionary
    slow = without_texts(own)
    names, all_objects = every_name(slow, slow if only is None else [only]), slow.without([(0x1A00, 2)])
    for name in names:
        fresh = own.without([(0x1A00, 2)])  # another dictionary, for which no name was looked for
        assert fresh.find(name) == all_objects.find(name), name
    return len(names)


@pytest.mark.parametrize("path", sorted(FAMILIES.glob("*/*.eds")), ids=lambda path: path.stem)
def test_every_name_of_a_family_is_found_in_its_text(path: Path) -> None:
    assert must_agree(path.read_bytes()) > 20


def test_names_of_connected_modules_are_found() -> None:
    data = (FAMILIES / "coupler" / "coupler.eds").read_bytes()
    assert must_agree(data, (1, 2)) > must_agree(data, ())


@given(NAMES, NAMES, NAMES, st.sampled_from(["", "CompactSubObj=3\n", "SubNumber=2\n"]))
def test_any_names_are_found(own: str, entry: str, denotation: str, key: str) -> None:
    text = f"\n[2222]\nParameterName={own}\nObjectType=9\nDataType=5\nAccessType=rw\nDenotation={denotation}\n{key}"
    table = f"[2222Name]\nNrOfEntries=1\n1={entry}\n" if "Compact" in key else f"[2222sub1]\nParameterName={entry}\n"
    must_agree(SAMPLE + (text + table).encode(), only=0x2222)


def test_only_objects_that_may_have_the_name_are_built() -> None:
    dictionary = parse_eds((FAMILIES / "gen4" / "gen4.eds").read_bytes(), "read first here.eds").dictionary
    assert [entry.object for entry in dictionary.find("velocity actual value")] == ["606C:00"]
    built = [index for index in dictionary if not callable(dictionary._objects[index])]
    assert 0x606C in built
    assert len(built) < 10 < len(dictionary)


def test_many_names_are_found_as_well() -> None:
    data = (FAMILIES / "gen4" / "gen4.eds").read_bytes()
    dictionary, slow = parse_eds(data, "a.eds").dictionary, without_texts(parse_eds(data, "a.eds").dictionary)
    for name in sorted(every_name(slow, slow)):
        assert dictionary.find(name) == slow.find(name), name
