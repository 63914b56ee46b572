"""A journal is read back as it was written, to the last value that fits, and refused from the first that does not."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.change.change_group import GroupMember
from dvtcli.device.change.journal import MOST_BYTES, JournalFolder, read_journal
from dvtcli.device.change.private_file import file_name, sync_folder
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.plan import PdoChange, Plan, Step, ValueChange, plan_pdo
from dvtcli.errors import InputFileError, SafetyRefusal
from tests.journals import journal_document

IDENTITY = {"vendor": 1, "product": None, "revision": 0xFFFF_FFFF, "serial": 4}
FULL = PdoConfig(
    PdoCommunicationParameter(CobId.from_raw(0xFFFF_FFFF), 0xFF, 0xFFFF, 0xFFFF, 0xFF),
    tuple(PdoMappingEntry.from_raw(0xFFFF_FFFF - number) for number in range(64)),
)
ODD = PdoConfig(FULL.communication, FULL.mapping[:3], held_count=0xFD, unread=((0x1A02, 4),))
HALF = PdoConfig(FULL.communication, (), unread=((0x1802, 1), (0x1A02, 0)))
BARE = PdoConfig(PdoCommunicationParameter(CobId.from_raw(0x181), None, None, None, None), ())
PLAN = Plan(
    127,
    (
        plan_pdo(Pdo.parse("tpdo1"), FULL, BARE),
        plan_pdo(Pdo.parse("rpdo512"), BARE, FULL),
        ValueChange(Step(0xFFFF, 0xFF, b"\1\2", b"\3\4", "write")),
        ValueChange(Step(0x2000, 0, None, b"", "write")),
        plan_pdo(Pdo.parse("tpdo3"), ODD, BARE)._replace(substitute=HALF),
    ),
)


@pytest.mark.parametrize("state", [None, 0, 5, 0xFF])
def test_a_journal_reads_back_as_it_was_written(tmp_path: Path, state: int | None) -> None:
    journals = JournalFolder(tmp_path / "journals", "socketcan:can0")
    path = journals.write(PLAN, IDENTITY, state)
    found = journals.find(127)
    assert found is not None
    assert (found.path, found.bus, found.plan) == (path, "socketcan:can0", PLAN)
    assert (found.identity, found.nmt_state) == (IDENTITY, state)
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    assert list(path.parent.iterdir()) == [path]
    assert journals.find(1) is None
    journals.remove(127)
    journals.remove(127)
    assert journals.find(127) is None


@pytest.mark.parametrize(
    ("text", "name"), [("socketcan:can0", "socketcan_can0"), ("a/../b", "a_.._b"), ("///", "bus"), ("_x_", "x")]
)
def test_file_names(text: str, name: str) -> None:
    assert file_name(text) == name


def test_a_folder_that_is_gone_needs_nothing(tmp_path: Path) -> None:
    sync_folder(tmp_path / "gone")


Spoil = Callable[[dict[str, Any]], object]
SPOILT: list[tuple[Spoil, str]] = [
    (lambda j: j.update(schema="dvtcli.journal/2"), "it does not say dvtcli.journal/1"),
    (lambda j: j.update(changes=[]), "it names no changes"),
    (lambda j: j.update(changes={}), "it names no changes"),
    (lambda j: j.update(changes=j["changes"][2:3] * 2049), "it names no changes"),
    (lambda j: j.update(changes=[7]), "a change is malformed"),
    (lambda j: j.update(node=0), "node is 0, expected 1..127"),
    (lambda j: j.update(node=128), "node is 128, expected 1..127"),
    (lambda j: j.update(node=True), "node is True, expected 1..127"),
    (lambda j: j.update(identity=[]), "identity is malformed"),
    (lambda j: j.update(identity={"serial": "4"}), "identity is malformed"),
    (lambda j: j.update(identity={"serial": True}), "identity is malformed"),
    (lambda j: j.update(nmt_state=256), "nmt_state is 256, expected 0..255"),
    (lambda j: j.update(nmt_state=-1), "nmt_state is -1, expected 0..255"),
    (lambda j: j["changes"][0].update(pdo="tpdo513"), "513"),
    (lambda j: j["changes"][0].update(before=None), "a configuration is malformed"),
    (lambda j: j["changes"][0]["before"].update(mpdo=0xFE), "a multiplexed PDO is malformed"),
    (lambda j: j["changes"][0]["after"].update(mpdo=0x10), "a multiplexed PDO is malformed"),
    (lambda j: j["changes"][0]["before"].update(mpdo=0x100), "mpdo is 256, expected 0..255"),
    (lambda j: j["changes"][0]["before"].update(held_count=0x100), "held_count is 256, expected 0..255"),
    (lambda j: j["changes"][0]["before"].update(unread={}), "what could not be read is malformed"),
    (lambda j: j["changes"][0]["before"].update(unread=[[1]]), "what could not be read is malformed"),
    (lambda j: j["changes"][0]["before"].update(unread=[[1, 0x100]]), "a number is 256, expected 0..255"),
    (lambda j: j["changes"][0]["before"].update(unread=[[0x1_0000, 1]]), "a number is 65536, expected 0..65535"),
    (lambda j: j["changes"][0].update(back=7), "a configuration is malformed"),
    (lambda j: j["changes"][0]["before"].update(cob_id=1 << 32), "cob_id is 4294967296, expected 0..4294967295"),
    (lambda j: j["changes"][0]["before"].update(transmission_type=256), "expected 0..255"),
    (lambda j: j["changes"][0]["before"].update(inhibit_time=0x1_0000), "expected 0..65535"),
    (lambda j: j["changes"][0]["before"].update(event_timer=0x1_0000), "expected 0..65535"),
    (lambda j: j["changes"][0]["before"].update(sync_start_value=256), "expected 0..255"),
    (lambda j: j["changes"][0]["before"].update(mapping=[0] * 65), "a mapping is malformed"),
    (lambda j: j["changes"][0]["before"].update(mapping={}), "a mapping is malformed"),
    (lambda j: j["changes"][0]["before"].update(mapping=[1 << 32]), "a number is 4294967296, expected 0..4294967295"),
    (lambda j: j["changes"][2].update(object=[1]), "an object is malformed"),
    (lambda j: j["changes"][2].update(object="12"), "an object is malformed"),
    (lambda j: j["changes"][2].update(object=[0x1_0000, 0]), "a number is 65536, expected 0..65535"),
    (lambda j: j["changes"][2].update(object=[0, 0x100]), "a number is 256, expected 0..255"),
    (lambda j: j["changes"][2].update(before="xy"), "non-hexadecimal"),
    (lambda j: j["changes"][2].pop("after"), "non-hexadecimal"),
]


@pytest.mark.parametrize(("spoil", "why"), SPOILT)
def test_a_damaged_journal_is_said_and_not_used(tmp_path: Path, spoil: Spoil, why: str) -> None:
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5)
    document = journal_document(path)
    spoil(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InputFileError) as caught:
        read_journal(path)
    assert caught.value.place == str(path)
    assert why in (caught.value.why or "")


def test_the_highest_object_may_be_the_one_that_could_not_be_read(tmp_path: Path) -> None:
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5)
    document = journal_document(path)
    document["changes"][0]["before"]["unread"] = [[0xFFFF, 0xFF], [0, 0]]
    path.write_text(json.dumps(document))
    change = read_journal(path).plan.changes[0]
    assert isinstance(change, PdoChange)
    assert change.before.unread == ((0xFFFF, 0xFF), (0, 0))


def test_most_changes_and_most_bytes(tmp_path: Path) -> None:
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5)
    document = journal_document(path)
    document["changes"] = document["changes"][2:3] * 2048
    text = json.dumps(document)
    path.write_text(text.ljust(MOST_BYTES))
    assert len(read_journal(path).plan.changes) == 2048
    path.write_text(text.ljust(MOST_BYTES + 1))
    with pytest.raises(InputFileError):
        read_journal(path)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="no /proc: open files cannot be counted")
def test_no_file_stays_open(tmp_path: Path) -> None:
    journals = JournalFolder(tmp_path, "can0")
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(3):
        journals.write(PLAN, IDENTITY, 5)
        journals.find(127)
        journals.remove(127)
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize(
    "part", [{"entries": 7}, {"entries": [1]}, {"entries": None}, {"name": 5}, {"final": 5}, {"whole": 5}]
)
def test_what_a_journal_belongs_to_is_words(tmp_path: Path, part: dict[str, Any]) -> None:
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5)
    path.write_text(json.dumps(journal_document(path) | part))
    with pytest.raises(InputFileError) as caught:
        read_journal(path)
    assert caught.value.why == "what it belongs to is malformed"


def test_what_a_journal_belongs_to_reads_back_and_need_not_be_said(tmp_path: Path) -> None:
    member = GroupMember("5f", "set-up.dvt", ("one", "two"), "store")
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5, member)
    assert read_journal(path).member == member
    document = journal_document(path)
    path.write_text(
        json.dumps({key: document[key] for key in document if key not in ("whole", "name", "entries", "final")})
    )
    assert read_journal(path).member == GroupMember()


def test_what_could_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    journals = JournalFolder(tmp_path, "can0")
    step = PLAN.changes[2:3]
    assert len(journals.write(Plan(5, step * 2048), IDENTITY, 5).read_text()) < MOST_BYTES
    large = ValueChange(Step(0x2000, 0, None, bytes(MOST_BYTES // 2), "write"))
    for changes in (step * 2049, (large,)):
        with pytest.raises(OSError, match="too large") as caught:
            journals.write(Plan(7, changes), IDENTITY, 5)
        assert caught.value.filename == str(journals.path(7))
        assert not journals.path(7).exists()


@pytest.mark.skipif(os.name != "posix", reason="Windows has no modes of this kind")
def test_a_journal_that_others_could_have_written_is_not_believed(tmp_path: Path) -> None:
    path = JournalFolder(tmp_path, "can0").write(PLAN, IDENTITY, 5)
    path.chmod(0o666)
    with pytest.raises(SafetyRefusal) as caught:
        read_journal(path)
    assert caught.value.text == f"{path} is not used: everybody can write it"
    assert (caught.value.place, typed(caught.value.hint)) == (str(path), f"chmod o-w {path}")
