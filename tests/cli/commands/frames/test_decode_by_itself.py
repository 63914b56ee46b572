"""`decode` and `plot` of a recording by nothing but what SDO transfers in it say of mappings."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench

#: TPDO1 of node 5 is read: COB-ID, count, 6041:00 of 16 bits
READ = ("585#4300180185010000", "585#4F001A0001000000", "585#43001A0110004160")
#: a master sets TPDO1 of node 6: off, 6064:00 of 32 bits, on with 0x1A0
SET = (
    "606#2300180186010080", "586#6000180100000000", "606#2F001A0000000000", "586#60001A0000000000",
    "606#23001A0120006460", "586#60001A0100000000", "606#2F001A0001000000", "586#60001A0000000000",
    "606#23001801A0010000", "586#6000180100000000",
)  # fmt: skip


@pytest.fixture(autouse=True)
def _ground(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def record(*frames: str, channels: tuple[str, ...] = ("can0",)) -> None:
    lines = (f"({number}.000000) {channels[number % len(channels)]} {one}\n" for number, one in enumerate(frames))
    Path("run.log").write_text("".join(lines), "ascii")


def run(words: str, **options: object) -> tuple[str, str]:
    with Bench((), options) as bench:
        ran = bench.run(words)
        assert ran.code == 0, ran
        return ran.stdout, ran.stderr


def test_frames_are_decoded_by_the_mapping_in_the_recording() -> None:
    record(*READ, *SET, "185#3712", "1A0#D2040000")
    out, said = run("decode run.log")
    last, before = out.splitlines()[-1], out.splitlines()[-2]
    assert "6041:00=" in before
    assert "6064:00=1234" in last
    assert "mappings from the SDO transfers in run.log: TPDO1 of node 5, TPDO1 of node 6" in said
    table = run("decode run.log --csv")[0].splitlines()
    assert "TPDO1 node 5 6041:00" in table[0]
    assert table[-1].endswith(",1234")
    assert "6064" in run("plot run.log 6064")[0]


def test_a_mapping_that_changed_meanwhile_decodes_nothing() -> None:
    record(*READ, "185#3712", "585#43001A0108006060", "185#0300")
    out, said = run("decode run.log")
    assert "=" not in out.splitlines()[-1]
    assert "TPDO1 of node 5 had other settings before: its mapping changed between frames: they remain bytes" in said


@pytest.mark.parametrize("length", [4, 6, 8])
def test_a_pdo_that_is_left_off_gives_no_mapping(length: int) -> None:
    """As after a refused write: the frames before it were sent by a mapping that nobody knows."""
    record("186#3712", *SET[:length])
    out, said = run("decode run.log")
    assert "TPDO1? node 6" in out.splitlines()[0]
    assert "TPDO1 of node 6 is disabled at the end: the mapping of its frames is unknown, they remain bytes" in said
    assert "mappings from the SDO transfers" not in said


def test_frames_from_before_a_download_are_not_read_by_what_it_sets() -> None:
    record("1A0#E8030000", *SET, "1A0#D2040000")
    out, said = run("decode run.log")
    assert "=" not in out.splitlines()[0] + out.splitlines()[-1]
    assert "TPDO1 of node 6 was configured after its first frames, whose mapping is unknown" in said


STARTS = "706#00"


def test_frames_of_a_node_that_started_anew_are_not_read_by_what_is_set_afterwards() -> None:
    record(*SET, "1A0#D2040000", STARTS, "1A0#E8030000", *SET)
    out, said = run("decode run.log")
    assert "6064:00=" not in out
    assert "TPDO1 of node 6 was configured after its first frames" in said


@pytest.mark.parametrize("between", [(STARTS,), ("1A0#E8030000",), (STARTS, *SET, STARTS)])
def test_what_is_set_again_before_a_frame_comes_is_known(between: tuple[str, ...]) -> None:
    record(*SET, "1A0#E8030000", *between, *SET, "1A0#D2040000")
    out, said = run("decode run.log")
    assert "6064:00=1234" in out.splitlines()[-1]
    assert "warning" not in said


def test_frames_from_before_an_upload_are_read_by_what_it_says() -> None:
    record("185#3712", *READ, "605#2B00180564000000", "585#6000180500000000", "185#3712")
    lines = run("decode run.log")[0].splitlines()
    assert ("6041:00=" in lines[0], "6041:00=" in lines[-1]) == (True, True)


@pytest.mark.parametrize("frames", [("185#3712",), READ[:2], (*READ, *SET)])
def test_where_nothing_is_said_frames_stay_bytes(frames: tuple[str, ...]) -> None:
    record(*frames, "185#3712", channels=("can0", "can1") if len(frames) > 3 else ("can0",))
    out, _ = run("decode run.log")
    assert "37 12" in out.splitlines()[-1]
    assert "=" not in out.splitlines()[-1]


def test_a_file_that_somebody_names_goes_before_it() -> None:
    record(*READ, "185#3712")
    assert "SDO transfers" not in run("decode run.log", eds="gen4")[1]


EDS = family_eds("generic")


@pytest.mark.parametrize("beside", [(), ("77F#05", "583#4B41600037120000")])
def test_an_eds_is_taken_for_the_only_node_with_pdos(beside: tuple[str, ...]) -> None:
    record("183#3712", *beside, "183#3702")
    out, said = run("decode run.log", eds=str(EDS))
    assert f"{EDS.name} is taken for node 3, the only one in run.log" in said
    assert "Statusword=" in out
    assert "TPDO1 node 3 6041:00 Statusword" in run("decode run.log --csv", eds=str(EDS))[0].splitlines()[0]
    with Bench((), {"eds": str(EDS)}) as bench:
        assert "is taken for node 3" in bench.run("check run.log").stderr


def test_an_eds_is_not_taken_silently_for_a_node_that_the_recording_lacks() -> None:
    record("183#3712", "184#3702")
    out, said = run("decode run.log", eds=str(EDS))
    assert f"{EDS.name} is taken for node 1, and run.log has nodes 3 and 4: -n 3" in " ".join(said.split())
    assert "Statusword" not in out
    out, said = run("decode run.log", eds=str(EDS), node=4)
    assert "taken for" not in said
    assert "Statusword=" in out.splitlines()[1]


def test_an_eds_stays_with_its_node_if_the_recording_has_it() -> None:
    record("181#3712", "184#3702")
    out, said = run("decode run.log", eds=str(EDS))
    assert "taken for" not in said
    assert "Statusword=" in out.splitlines()[0]


def test_a_dcf_is_about_its_own_node() -> None:
    with Bench(("generic@5",), {"yes": True}) as bench:
        assert bench.run("export five.dcf").code == 0
    record("183#3712")
    said = run("decode run.log", eds="five.dcf")[1]
    assert "five.dcf is taken for node 5, and run.log has node 3: -n 3" in " ".join(said.split())
