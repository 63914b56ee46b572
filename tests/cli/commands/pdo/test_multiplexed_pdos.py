"""Multiplexed PDOs: drawn with their eight bytes, switched at any time, made by `set --mpdo`, and put back."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench
from tests.small_eds import U32, plain, var

COUNT, FIRST, COB_ID = (0x1A00, 0), (0x1A00, 1), (0x1800, 1)


@pytest.fixture(autouse=True)
def device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An EDS whose device knows MPDOs; one of its TPDO1 comes up as one."""
    monkeypatch.chdir(tmp_path)
    eds = plain()
    eds.record(0x1011, "Restore", {1: var("Restore all", U32, 1)})
    eds.info = {"GroupMessaging": 1}
    Path("plain.eds").write_text(eds.text())
    for name, count in (("sam", 0xFE), ("dam", 0xFF)):
        text = eds.text()
        start = text.index("[1A00sub0]")
        changed = text[start:].replace("DefaultValue=0x1\n", f"DefaultValue={count}\n", 1)
        assert changed != text[start:]
        Path(f"{name}.eds").write_text(text[:start] + changed)


def held(bench: Bench) -> list[str]:
    return [bench.session.node().sdo.upload(*place).hex() for place in (COUNT, FIRST, COB_ID)]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sam", ("source", "at the source", "SAM, count 0xFE", "bit 7 of byte 0 is 0", "scanner list (0x1FA0…0x1FCF)")),
        ("dam", ("target", "at the target", "DAM, count 0xFF", "bit 7 of byte 0 is 1", "it sends 6000:01")),
    ],
)
def test_its_eight_bytes_are_drawn(name: str, words: tuple[str, ...]) -> None:
    with Bench((f"{name}.eds",)) as bench:
        shown = bench.run("pdo tpdo1").stdout
    assert [word for word in (*words, "node-ID", "index", "sub-index", "value") if word not in shown] == [], shown
    assert "free" not in shown


@pytest.mark.parametrize("name", ["sam", "dam"])
def test_it_is_switched_off_and_on_by_bit_31_only(name: str) -> None:
    with Bench((f"{name}.eds",), {"yes": True}) as bench:
        before = held(bench)
        off = bench.run("disable tpdo1 --json")
        assert (off.code, len(off.document["steps"])) == (0, 1), off
        assert held(bench) == [*before[:2], "81010080"]
        assert bench.run("enable tpdo1").code == 0
        assert held(bench) == before


@pytest.mark.parametrize(("kind", "count"), [("sam", "fe"), ("dam", "ff")])
@pytest.mark.parametrize("earlier", ["plain", "sam", "dam"])
def test_set_makes_one_in_order_and_undo_takes_it_back(kind: str, count: str, earlier: str) -> None:
    with Bench((f"{earlier}.eds",), {"yes": True}) as bench:
        before = held(bench)
        ran = bench.run(f"set tpdo1 --mpdo {kind}")
        if earlier == kind:
            assert ran.code == 0, ran
            return
        assert ran.code == 0, ran
        assert held(bench) == [count, *before[1:]]
        assert bench.run("undo").code == 0
        assert held(bench) == before


def test_an_empty_pdo_becomes_one() -> None:
    with Bench(("plain.eds",), {"yes": True}) as bench:
        assert bench.run("clear tpdo2").code == 0
        ran = bench.run("set tpdo2 --mpdo sam --off")
        assert ran.code == 0, ran
        assert bench.session.node().sdo.upload(0x1A01, 0) == b"\xfe"


@pytest.mark.parametrize(
    ("name", "line", "said"),
    [
        ("sam", "map tpdo1 6000:01", "clear tpdo1"),
        ("plain", "set tpdo1 --mpdo sam --sync 1", "must be event-driven"),
        ("plain", "write 1A01:00 254", "set tpdo2 --mpdo sam"),
    ],
)
def test_what_makes_no_mpdo_is_refused_with_the_way(name: str, line: str, said: str) -> None:
    with Bench((f"{name}.eds",), {"yes": True}) as bench:
        before = held(bench)
        ran = bench.run(line)
        ran.failed(1, said)
        assert held(bench) == before


def test_a_device_that_says_it_has_none_is_warned_of_and_refuses() -> None:
    Path("none.eds").write_text(Path("plain.eds").read_text().replace("GroupMessaging=0x1", "GroupMessaging=0"))
    with Bench(("none.eds",), {"yes": True}) as bench:
        before = held(bench)
        ran = bench.run("set tpdo1 --mpdo sam")
        assert ran.code == 1, ran
        assert "GroupMessaging=0 in none.eds" in ran.stderr
        assert held(bench) == before


def test_after_clear_it_is_mapped_as_any() -> None:
    with Bench(("sam.eds",), {"yes": True}) as bench:
        assert [bench.run(line).code for line in ("clear tpdo1", "map tpdo1 6000:02")] == [0, 0]
        assert held(bench) == ["01", "08020060", "81010000"]


@pytest.mark.parametrize("option", ["", " --history"])
@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("plain", ["set tpdo1 --mpdo dam --event"]),
        ("plain", ["set tpdo1 --mpdo sam --off"]),
        ("plain", ["map tpdo1 6000:03 --off", "set tpdo1 --mpdo dam", "enable tpdo1"]),
        ("plain", ["clear tpdo2", "set tpdo2 --mpdo sam --cob-id 0x190", "enable tpdo2"]),
        ("plain", ["restore", "nmt reset-node", "set tpdo1 --mpdo dam --timer 100"]),
        ("dam", ["set tpdo1 --timer 100", "set tpdo2 --timer 50"]),
        ("dam", ["disable tpdo1"]),
        ("sam", ["set tpdo1 --mpdo dam --timer 100"]),
        ("sam", ["clear tpdo1", "map tpdo1 6000:02", "set tpdo1 --mpdo dam"]),
    ],
)
def test_what_a_session_made_of_one_is_saved_and_runs_elsewhere(name: str, lines: list[str], option: str) -> None:
    places = [*((index, sub) for index in (0x1A00, 0x1A01) for sub in (0, 1)),
              *((index, sub) for index in (0x1800, 0x1801) for sub in (1, 2, 5))]  # fmt: skip
    with Bench((f"{name}.eds",), {"yes": True}) as bench:
        assert [bench.run(line).code for line in lines] == [0] * len(lines)
        saved = bench.run(f"save x.dvt{option}")
        assert saved.code == 0, saved
        wanted = [bench.session.node().sdo.upload(*place) for place in places]
    with Bench((f"{name}.eds",), {"yes": True}) as bench:
        ran = bench.run("run x.dvt")
        assert ran.code == 0, (ran, Path("x.dvt").read_text())
        assert [bench.session.node().sdo.upload(*place) for place in places] == wanted, Path("x.dvt").read_text()


@pytest.mark.parametrize("name", ["sam", "dam"])
@pytest.mark.parametrize("end", ["dcf", "xdc", "jsonl"])
def test_a_file_of_one_makes_one_again(name: str, end: str) -> None:
    """The count 0xFE or 0xFF of a device's file is written in the order of a mapping, and verified."""
    with Bench((f"{name}.eds",), {"yes": True}) as bench:
        assert bench.run(f"backup kept.{end}").code == 0
        whole = held(bench)
        assert bench.run("clear tpdo1").code == 0
        assert bench.run("map tpdo1 6000:02").code == 0
        planned = bench.run(f"plan kept.{end}")
        assert (planned.code, "TPDO1" in planned.stdout, "differs, not written" in planned.stdout) == (0, True, False)
        assert bench.run(f"verify kept.{end}").code == 3
        done = bench.run(f"apply kept.{end}")
        assert (done.code, held(bench)[0], held(bench)[2]) == (0, whole[0], whole[2]), done
        assert name == "sam" or held(bench) == whole
        assert bench.run(f"verify kept.{end}").code == 0
        assert "No difference" in bench.run(f"plan kept.{end}").stdout


def test_a_node_that_is_one_takes_a_files_plain_mapping_only_after_clear() -> None:
    with Bench(("plain.eds",), {"yes": True}) as bench:
        assert bench.run("backup kept.dcf").code == 0
    with Bench(("sam.eds",), {"yes": True}) as bench:
        refused = bench.run("apply kept.dcf")
        refused.failed(1, "clear tpdo1")
        assert bench.run("clear tpdo1").code == 0
        assert bench.run("apply kept.dcf").code == 0
