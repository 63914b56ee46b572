"""Values of JSON documents, not only that they are there."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.process import documents, dvtcli

MAP = "map tpdo1 6041 606C/32 6C01:1 --sync 1"


def test_each_entry_says_where_it_begins() -> None:
    ran = dvtcli("--sim", "gen4", "--json", stdin=f"{MAP}\npdo tpdo1\n")
    assert ran.returncode == 0, ran.stderr
    (row,) = documents(ran.stdout)[-1]["pdos"]
    assert [(entry["object"], entry["bits"], entry["start_bit"]) for entry in row["mapping"]] == [
        ("6041:00", 16, 0),
        ("606C:00", 32, 16),
        ("6C01:01", 16, 48),
    ]
    assert row["bits"] == 64


@pytest.mark.parametrize(("timer_ms", "equal", "code"), [(70, True, 0), (71, False, 3)])
def test_a_read_back_is_equal_or_it_is_not(tmp_path: Path, timer_ms: int, equal: bool, code: int) -> None:
    eds = family_eds("gen4").read_text("latin-1")
    heading = next(line for line in eds.splitlines() if line.lower() == "[1800sub5]")
    wanted = tmp_path / "wanted.dcf"
    wanted.write_text(eds.replace(heading, f"{heading}\nParameterValue=70", 1), "latin-1")
    ran = dvtcli("--sim", "gen4", "--json", stdin=f"set tpdo1 --timer {timer_ms}\nverify tpdo1 {wanted}\n")
    (verified,) = (one for one in documents(ran.stdout) if one["schema"] == "dvtcli.verify/1")
    assert verified["schema"] == "dvtcli.verify/1", verified
    assert (verified["equal"], ran.returncode) == (equal, code)
    assert [one["pdo"] for one in verified["differences"]] == ([] if equal else ["tpdo1"])
