"""`backup` and `compare`: what a device held, and what is otherwise now, by what it means."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

import dvtcli
from dvtcli.device.read_whole import scan_objects
from dvtcli.domain.configuration import Configuration
from dvtcli.domain.ports import Frame
from dvtcli.errors import SafetyRefusal
from dvtcli.files.device_file import read_device_file
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.whole_device_file import read_whole_device
from dvtcli.operations.devices.backup_device import backup_device
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.operations.devices.test_export_dcf import FAMILIES, odd
from tests.real_files import real_files
from tests.small_eds import U16, U32, plain, var
from tests.virtual_time import VirtualTimeBus

FORMS = ["dcf", "jsonl", "xdc"]


@pytest.mark.drawn(6)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_device_is_as_its_backup_says_until_a_setting_changes(family: str, form: str, tmp_path: Path) -> None:
    file = tmp_path / f"node.{form}"
    with Bench((f"{family}@5",)) as bench:
        kept = bench.run(f"backup {file} --json").document
        assert kept["schema"] == "dvtcli.backup/1"
        same = bench.run(f"compare {file} --json")
        assert (same.code, same.document["equal"], same.document["unlike"]) == (0, True, "")
        assert 0 < same.document["objects"] <= kept["objects"]
        assert bench.run(f"compare {file} {file}").code == 0


def test_a_backup_that_was_cut_short_is_said_with_the_line_and_column_of_the_file(tmp_path: Path) -> None:
    whole, cut = tmp_path / "a.jsonl", tmp_path / "cut.jsonl"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"backup {whole}").code == 0
        lines = whole.read_bytes().splitlines(keepends=True)
        for left, place in ((b'{"object": "10', f"{cut}:21:12"), (b"", f"{cut}:20")):
            cut.write_bytes(b"".join(lines[:20]) + left)
            for command in (f"plan {cut}", f"compare {cut}", f"compare {whole} {cut}"):
                ran = bench.run(command)
                assert (ran.code, "line 1" in ran.stderr, f"  file    {place}\n" in ran.stderr) == (4, False, True)
                assert bench.run(f"{command} --json").documents[-1]["file"] == place


def test_each_setting_that_differs_is_named(tmp_path: Path) -> None:
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"backup {tmp_path / 'a.dcf'}").code == 0
        assert bench.run("set tpdo1 --timer 100").code == 0
        assert bench.run("write 1017 700").code == 0
        document = bench.run(f"compare {tmp_path / 'a.dcf'} --json").document
        assert [one["object"] for one in document["differences"]] == ["1017:00", "1800:05"]
        assert document["differences"][1]["value_after"] == 100
        ran = bench.run(f"compare {tmp_path / 'a.dcf'}")
        assert ran.code == 3
        assert "2 of " in ran.stdout
        assert bench.run(f"backup {tmp_path / 'b.jsonl'}").code == 0
        both = bench.run(f"compare {tmp_path / 'a.dcf'} {tmp_path / 'b.jsonl'} --json")
        assert (both.code, both.document["node"]) == (3, None)
        assert [one["object"] for one in both.document["differences"]] == ["1017:00", "1800:05"]


@pytest.mark.parametrize("chosen", [None, "tmcm"])
def test_two_backups_have_names_where_an_eds_of_their_identity_is_known(chosen: str | None, tmp_path: Path) -> None:
    before, after = tmp_path / "a.jsonl", tmp_path / "b.jsonl"
    with Bench(("tmcm@5",)) as bench:
        for line in (f"backup {before}", "write 2705 90", f"backup {after}"):
            assert bench.run(line).code == 0
    with Bench((), {} if chosen is None else {"eds": chosen}) as bench:
        (one,) = bench.run(f"compare {before} {after} --json").document["differences"]
        assert (one["object"], one["name"]) == ("2705:00", "Current scaling")


@heavy
def test_what_follows_the_node_id_is_no_difference_on_another_node(tmp_path: Path) -> None:
    for form in FORMS:
        with Bench(("generic@5",)) as bench:
            assert bench.run("disable tpdo1").code == 0
            assert bench.run(f"backup {tmp_path / 'a'}.{form}").code == 0
        with Bench(("generic@7",)) as other:
            document = other.run(f"compare {tmp_path / 'a'}.{form} --json").document
        assert [one["object"] for one in document["differences"]] == ["1800:01"]
        assert document["differences"][0]["value_before"] & 0x9FFF_FFFF == 0x8000_0187


def test_entries_beyond_the_count_of_a_mapping_mean_nothing(tmp_path: Path) -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("map tpdo1 6041 606C").code == 0
        assert bench.run("map tpdo1 6041").code == 0
        assert bench.run(f"backup {tmp_path / 'a.dcf'}").code == 0
        assert bench.run("map tpdo1 6041 6041").code in (0, 1)
        assert bench.run("map tpdo1 6041").code == 0
        assert bench.run(f"compare {tmp_path / 'a.dcf'}").code == 0


@heavy
def test_commands_are_told_apart_and_secrets_are_not_read(tmp_path: Path) -> None:
    with Bench((str(odd(tmp_path)),)) as bench:
        for form in FORMS:
            file = tmp_path / f"a.{form}"
            document = bench.run(f"backup {file} --json").document
            out = {one["object"]: one["why"] for one in document["left_out"]}
            assert out["2003:00"] == "part of a login"
            assert out["2001:00"] == "write-only"
            assert bench.run("write 6040 0").code == 0
            assert bench.run("write 6040 7").code == 0
            compared = bench.run(f"compare {file} --json")
            assert (compared.code, [one["object"] for one in compared.document["apart"]]) == (0, ["6040:00"])
            assert "6040:00 is not a setting: not counted" in bench.run(f"compare {file}").stdout
            assert "  6040:00  Controlword" in bench.run(f"compare {file} --all").stdout
            assert bench.run("write 6040 0").code == 0
    dictionary = read_eds(tmp_path / "a.dcf").dictionary
    assert dictionary[0x2003].entries[0].value is None
    assert dictionary[0x1018].entries[1].value is not None  # a backup has what a device says of itself


def test_an_eds_is_compared_by_its_defaults(tmp_path: Path) -> None:
    eds = odd(tmp_path)
    with Bench((str(eds),)) as bench:
        assert bench.run(f"compare {eds}").code == 0
        assert bench.run("write 2000 7").code == 0
        document = bench.run(f"compare {eds} --json").document
    assert [(one["object"], one["value_before"], one["value_after"]) for one in document["differences"]] == [
        ("2000:00", 100, 7)
    ]


def test_another_device_is_said_to_be_one(tmp_path: Path) -> None:
    with Bench(("gen4@5",)) as bench:
        assert bench.run(f"backup {tmp_path / 'a.jsonl'}").code == 0
    with Bench(("tmcm@5",)) as other:
        ran = other.run(f"compare {tmp_path / 'a.jsonl'} --json")
    assert ran.code == 3
    assert ran.document["unlike"].startswith("vendor 0x")
    refused = [one for one in ran.document["differences"] if one["after"] is None]
    assert all("does not exist" in one["why"] for one in refused)
    assert refused


def test_what_changes_by_itself_is_told_apart(tmp_path: Path) -> None:
    eds = plain()
    eds.variable(0x2010, var("Running hours", U32, 0))
    path = tmp_path / "clock.eds"
    path.write_text(eds.text(), "utf-8")
    with Bench((str(path),), {"signal": ("2010=ramp(0,4000000000,60s)",)}) as bench:  # 66 counts each microsecond
        assert bench.run(f"backup {tmp_path / 'a.dcf'}").code == 0
        bench.session.wire.sleep(0.1)  # a signal is sampled each 0.01 s
        document = bench.run(f"compare {tmp_path / 'a.dcf'} --json").document
        assert (document["equal"], [one["object"] for one in document["apart"]]) == (True, ["2010:00"])
        kept = bench.run(f"backup {tmp_path / 'b.dcf'} --twice --json").document
        assert {"object": "2010:00", "why": "it changes by itself"} in kept["left_out"]


def test_what_is_not_to_be_read_on_a_scan_is_read_where_a_file_says_its_value(tmp_path: Path) -> None:
    eds = plain()
    eds.variable(0x1017, var("Producer heartbeat time", U16, 500, ObjFlags=2))
    eds.variable(0x2001, var("Ramp", U16, 5))
    flagged, said, same = tmp_path / "flagged.eds", tmp_path / "said.dcf", tmp_path / "same.jsonl"
    flagged.write_text(eds.text(), "utf-8")
    eds.variable(0x1017, var("Producer heartbeat time", U16, 500, ObjFlags=2, ParameterValue=2000))
    eds.variable(0x2001, var("Ramp", U16, 5, ParameterValue=5))
    said.write_text(eds.text(), "utf-8")
    with Bench((f"{flagged}@5",)) as bench:
        compared = bench.run(f"compare {said} --json")
        assert (compared.code, compared.document["equal"]) == (3, False)
        assert [(one["object"], one["after"], one["why"]) for one in compared.document["differences"]] == [
            ("1017:00", "F4 01", "")
        ], "the file itself names it: that is not a scan"
        assert bench.run(f"compare {flagged}").code == 0  # a default alone says nothing of it
        assert bench.run(f"backup {same}").code == 0
        kept = bench.run(f"compare {same} --json").document
        both = bench.run(f"compare {said} {same} --json").document
    assert (kept["equal"], kept["unsaid"]) == (True, 1)
    assert both["unsaid"] >= 1


def test_a_device_without_an_eds_is_asked_for_each_index(tmp_path: Path) -> None:
    areas = (range(0x1000, 0x1020), range(0x1400, 0x1402), range(0x1600, 0x1602), range(0x6040, 0x6042))
    with Bench(("generic@5",)) as bench:
        node = bench.session.node()
        described, node.dictionary = node.dictionary, None
        assert described is not None
        found = scan_objects(node, Configuration(node.profile), areas)
        backup_device(bench.session, str(tmp_path / "a.jsonl"), areas=areas)
        there = set()
        for entry in described.entries():
            beyond_count = entry.sub_index and (entry.index == 0x1003 or entry.index & 0x1600 == 0x1600)
            if any(entry.index in area for area in areas) and entry.access.readable and not beyond_count:
                there.add((entry.index, entry.sub_index))
        assert there <= found.keys()
        kept = read_whole_device(tmp_path / "a.jsonl")
        assert {place for place, one in kept.objects.items() if one.data is not None} >= there
        assert kept.eds == ""
        assert bench.run(f"compare {tmp_path / 'a.jsonl'}").code == 0
        assert bench.run("write 1017 77").code == 0
        assert bench.run(f"compare {tmp_path / 'a.jsonl'} --json").document["differences"][0]["object"] == "1017:00"


def test_words_that_are_no_backup(tmp_path: Path) -> None:
    (tmp_path / "bad.jsonl").write_text("{", "utf-8")
    with Bench(("generic",)) as bench:
        assert bench.run(f"backup {tmp_path / 'a.yaml'}").code == 2
        assert bench.run(f"compare {tmp_path / 'none.dcf'}").code == 2
        assert bench.run(f"compare {tmp_path / 'bad.jsonl'}").code == 4
        assert bench.run(f"backup {tmp_path / 'bad.jsonl'}").code == 6
        bench.session.node().dictionary = None
        assert bench.run(f"backup {tmp_path / 'a.dcf'}").code == 2


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "real" in metafunc.fixturenames:
        paths = real_files(metafunc.config)
        metafunc.parametrize("real", paths, ids=[path.name for path in paths])


def test_a_device_of_a_real_file_is_as_its_files_say(real: Path, tmp_path: Path) -> None:
    with Bench((f"{real}@5",)) as bench:
        for word in ("backup a.dcf", "backup a.jsonl", "backup a.xdc", "export b.dcf", "export b.xdc"):
            command, name = word.split()
            assert bench.run(f"{command} {tmp_path / name}").code == 0, word
            compared = bench.run(f"compare {tmp_path / name} --json")
            assert (compared.code, compared.document["differences"]) == (0, []), word
    for name in ("a.jsonl", "a.xdc", "b.dcf", "b.xdc"):
        with Bench() as bench:
            assert bench.run(f"compare {tmp_path / 'a.dcf'} {tmp_path / name} --json").document["differences"] == []


def uploads(bench: Bench, line: str) -> Counter[tuple[int, int]]:
    """How often each object is asked for while *line* runs."""
    found: Counter[tuple[int, int]] = Counter()

    def take(frame: Frame, _sent: bool) -> None:
        if frame.can_id & ~0x7F == 0x600 and frame.data[:1] == b"\x40":
            found[int.from_bytes(frame.data[1:3], "little"), frame.data[3]] += 1

    bench.session.node()
    stop = bench.session.wire.tap(take)
    assert bench.run(line).code == 0
    stop()
    return found


def test_each_object_is_asked_for_once_and_what_an_rpdo_may_change_twice(tmp_path: Path) -> None:
    with Bench((str(odd(tmp_path)),)) as bench:
        dictionary = bench.session.node().dictionary
        assert dictionary is not None
        asked = uploads(bench, f"backup {tmp_path / 'a.jsonl'}")
        twice = uploads(bench, f"backup {tmp_path / 'b.jsonl'} --twice")
    never = {(0x2001, 0), (0x2002, 0), (0x2003, 0)}
    for entry in dictionary.entries():
        place = entry.index, entry.sub_index
        if place in never:
            assert asked[place] == twice[place] == 0
        elif entry.index not in (0x1000, 0x1018):  # who it is, is asked beside
            is_suspect = entry.pdo_mapping and entry.access.writable
            assert (asked[place], twice[place]) == (2 if is_suspect else 1, 2), entry.object


def test_a_device_of_an_xdd_is_exported_in_both_forms(tmp_path: Path) -> None:
    xdd = tmp_path / "odd.xdd"
    with Bench() as bench:
        assert bench.run(f"eds convert {odd(tmp_path)} {xdd}").code == 0
    with Bench((f"{xdd}@9",)) as bench:
        for name in ("a.dcf", "a.xdc"):
            document = bench.run(f"export {tmp_path / name} --json").document
            assert (document["eds"], document["objects"] > 20) == ("odd.xdd", True)
            assert bench.run(f"compare {tmp_path / name}").code == 0
            assert read_device_file(tmp_path / name).dictionary.info.node_id == 9


def test_programs_do_the_same(tmp_path: Path) -> None:
    with dvtcli.simulate("generic") as bus:
        node = bus.node()
        node.backup(tmp_path / "a.jsonl")
        node.export(tmp_path / "a.dcf")
        node.export(tmp_path / "a.yaml")
        with pytest.raises(SafetyRefusal):
            node.backup(tmp_path / "a.jsonl")
        node.backup(tmp_path / "a.jsonl", yes=True)
        assert node.compare(tmp_path / "a.jsonl")
        node.write("1017", 700)
        compared = node.compare(tmp_path / "a.dcf")
    assert not compared
    assert [one.object for one in compared.differences] == ["1017:00"]


def test_a_default_that_was_not_read_is_named(tmp_path: Path) -> None:
    eds = odd(tmp_path)
    with Bench((str(eds),)) as bench:
        compared = bench.run(f"compare {eds}")
        assert (compared.code, "2002:00" in compared.stdout, "not compared" in compared.stdout) == (0, True, True)
        assert "2002:00" in bench.run(f"compare {eds} --json").document["unread"]


def test_a_backup_without_an_eds_says_what_it_is_not_for(tmp_path: Path) -> None:
    bus = VirtualTimeBus([unknown(5)], simulated=False)
    with Bench((), {"node": (5,), "journal": str(tmp_path)}, bus) as bench:
        kept = backup_device(bench.session, str(tmp_path / "node.jsonl"), areas=(range(0x1000, 0x1020),))
        assert "node 5 has no EDS: " in str(kept.text[-1])
        assert bench.run(f"compare {tmp_path / 'node.jsonl'}").code == 0


def test_a_backup_of_nothing_and_a_comparison_of_nothing_are_no_success(tmp_path: Path) -> None:
    empty, other = tmp_path / "empty.jsonl", tmp_path / "other.jsonl"
    with Bench(("generic@5",)) as bench:
        assert bench.run(f"backup {tmp_path / 'a.jsonl'}").code == 0
        head = '{"schema": "dvtcli.whole-device/1", "node": 5, "identity": {"vendor": 1}, "made": "", "objects": %d}\n'
        empty.write_text(head % 0, "utf-8")
        other.write_text(head % 1 + '{"object": "2FF0:00", "type": "u8", "raw": "00"}\n', "utf-8")
        for words in (f"{empty}", f"{empty} {empty}", f"{tmp_path / 'a.jsonl'} {other}"):
            ran = bench.run(f"compare {words}")
            assert (ran.code, "nothing compared" in ran.stderr, ran.stdout) == (2, True, ""), words
    eds = plain()
    eds.objects = {0x5EF0: ("Ramp", {None: var("Ramp", U16, 100)})}
    (tmp_path / "alien.eds").write_text(eds.text(), "utf-8")
    bus = VirtualTimeBus([unknown(5)], simulated=False)
    with Bench((), {"node": (5,), "eds": str(tmp_path / "alien.eds"), "force": True}, bus) as bench:
        for name in ("b.jsonl", "b.dcf", "b.xdc"):
            ran = bench.run(f"backup {tmp_path / name}")
            ran.failed(2, "no object of node 5 could be read")
            assert not (tmp_path / name).exists()
