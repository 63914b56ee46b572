"""Objects and PDOs with commas between them are several; a name with a comma stays one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.commands.bench import Bench

ENTRIES = ["6041:00", "606C:00"]


@pytest.mark.parametrize(
    "written",
    ["0x6041,0x606C", "6041, 606C", "6041 ,606C", "6041 , 606C", "6041,606C,", "statusword,606C", "6041.0,606C/0"],
)
def test_commas_stand_between_objects(written: str) -> None:
    with Bench() as bench:
        assert bench.run(f"map tpdo1 {written}").code == 0
        (pdo,) = bench.run("pdo tpdo1 --json").document["pdos"]
        assert [entry["object"] for entry in pdo["mapping"]] == ENTRIES
        read = bench.run(f"read {written} --json")
        assert [one["object"] for one in read.documents[0]["values"]] == ENTRIES


def test_a_length_keeps_its_meaning_beside_a_comma() -> None:
    with Bench() as bench:
        assert bench.run("map rpdo1 dummy/8,6040/16,60FF/0 --dry-run").code == 0
        assert bench.run("map rpdo1 6040/8,60FF").code == 1  # 8 of 16 bits


def test_commas_stand_between_pdos() -> None:
    with Bench() as bench:
        assert bench.run("disable tpdo1,tpdo2 rpdo1").code == 0
        off = [row["pdo"] for row in bench.run("pdo --all --json").document["pdos"] if not row["enabled"]]
        assert {"tpdo1", "tpdo2", "rpdo1"} <= set(off)


def test_a_node_stands_before_each_object_or_before_none() -> None:
    with Bench(("gen4@1", "gen4@3")) as bench:
        assert bench.run("read 3:6041,1:606C").code == 0
        ran = bench.run("read 3:6041,606C")
        assert ran.code == 2
        assert "write the node before each of them" in ran.stderr


def test_a_name_with_a_comma_is_one_name(tmp_path: Path) -> None:
    from dvtcli.files.profiles import builtin_path

    text = (builtin_path("gen4").parent / "gen4.eds").read_text("latin-1")
    file = tmp_path / "own.eds"
    file.write_text(text.replace("ParameterName=Statusword pump", "ParameterName=Status,word"), "latin-1")
    with Bench((str(file),)) as bench:
        assert bench.run("read Status,word").code == 0
        assert bench.run("read Status, word").code == 2
