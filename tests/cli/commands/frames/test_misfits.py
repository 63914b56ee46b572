"""Frames read by a layout that cannot be their sender's: said once for each CAN-ID, and where the frame is shown."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.watch.seen import FrameStore
from tests.cli.commands.bench import Bench

LONG, SHORT, FITS = "181#3712010203040506", "281#01020304", "181#3712"
DBC = 'VERSION ""\nBU_: dvt\nBO_ 385 Gen4_TPDO1: 2 dvt\n SG_ Statusword : 0|16@1+ (1,0) [0|0] "" dvt\n'


def log(folder: Path, *frames: str) -> Path:
    path = folder / "r.log"
    path.write_text("".join(f"({1_795_442_572 + n}.000000) can0 {frame}\n" for n, frame in enumerate(frames)))
    return path


def warnings(stderr: str) -> list[str]:
    return [line for line in stderr.replace("\n  ", " ").splitlines() if line.startswith("warning: ")]


@pytest.mark.parametrize("line", ["decode {}", "decode {} --json", "decode {} --csv", "decode {} -o {}.csv"])
def test_a_recording_that_another_mapping_made_is_said_once_a_can_id(tmp_path: Path, line: str) -> None:
    path = log(tmp_path, LONG, LONG, SHORT, SHORT)
    with Bench(("gen4",)) as bench:
        ran = bench.run(line.format(path, path))
    assert ran.code == 0
    long, short = warnings(ran.stderr)
    assert "0x181: the frame has 8 bytes, the mapping of the simulated node 1 has 2 for TPDO1 of node 1" in long
    assert "0x281: the frame has 4 bytes, the mapping of the simulated node 1 has 8 for TPDO2 of node 1" in short


def test_what_fits_is_said_nothing_of(tmp_path: Path) -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"decode {log(tmp_path, FITS, '301#010203040506', '301#0102030405060708', '181#R')}")
    assert (warnings(ran.stderr), "mapped" in ran.stdout) == ([], False), "an RPDO takes the front of a longer frame"


def test_the_row_has_both_lengths(tmp_path: Path) -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"decode {log(tmp_path, LONG, FITS, SHORT)}")
    assert [line.partition("[")[2] for line in ran.stdout.splitlines()] == [
        "8 bytes, 2 mapped]",
        "",
        "4 bytes, 8 mapped]",
    ]


def test_who_says_so_is_named(tmp_path: Path) -> None:
    path = log(tmp_path, LONG)
    (tmp_path / "x.dbc").write_text(DBC)
    (tmp_path / "line.yaml").write_text("drive: {node_id: 1, profile: gen4, tpdo: {1: {mapping: [6041]}}}\n")
    for options, words in (
        ({"eds": str(family_eds("gen4"))}, "the mapping in gen4.eds has 2"),
        ({}, "x.dbc has 2 for Gen4_TPDO1"),
        ({}, "the mapping in line.yaml has 2"),
    ):
        dbc = (
            "" if options else f"-d {tmp_path / words.split()[0]}" if "dbc" in words else f"-d {tmp_path / 'line.yaml'}"
        )
        with Bench((), options) as bench:
            (said,) = warnings(bench.run(f"decode {path} {dbc}").stderr)
        assert words in said


def test_a_plot_says_it_of_what_it_draws(tmp_path: Path) -> None:
    path = log(tmp_path, LONG, LONG, SHORT, SHORT)
    with Bench(("gen4",)) as bench:
        (said,) = warnings(bench.run(f"plot {path} Statusword").stderr)
    assert said.startswith("warning: 0x181: ")


def test_a_frame_explained_says_what_is_cut_and_what_is_behind() -> None:
    with Bench(("gen4",)) as bench:
        cut = bench.run("explain 281#0102 --json")
        behind = bench.run(f"explain {LONG} --json")
        taken = bench.run("explain 301#0102030405060708 --json")
    assert [(one["place"], one["object"], one["text"]) for one in cut.document["parts"][2:]] == [
        ("bytes 0-1", "606C:00", "cut off: 16 of its 32 bits are there")
    ]
    assert behind.document["parts"][-1]["text"] == "so the mapping is not its sender's"
    assert taken.document["parts"][-1]["text"] == "RPDO2 of node 1 does not take it"
    assert [len(warnings(ran.stderr)) for ran in (cut, behind, taken)] == [1, 1, 0]


def test_a_short_frame_is_one_that_an_rpdo_does_not_take() -> None:
    with Bench(("gen4",)) as bench:
        (said,) = warnings(bench.run("explain 301#010203").stderr)
    assert "a node ignores frames shorter than its RPDO" in said


def test_every_set_bit_of_a_status_is_named() -> None:
    with Bench(("gen4",)) as bench:
        parts = bench.run("explain 181#3790 --json").document["parts"]
    names = [one["name"] for one in parts if one["text"] == "set"]
    assert names[-2:] == ["bit 12", "bit 15"]
    assert sum(one["bits"] == 1 and one["raw"] for one in parts) == (0x9037).bit_count()


def test_a_question_says_a_value_once() -> None:
    with Bench(("gen4",), {"yes": False}) as bench:
        ran = bench.run("send 181#3712")
    assert "6041:00 operation enabled (0x1237)" in ran.stderr
    assert "set, set" not in ran.stderr


def test_the_monitor_has_an_event_for_it() -> None:
    with Bench(("gen4",)) as bench:
        from dvtcli.operations.frames.layouts import live_decoder
        from dvtcli.watch.decoder import Decoder

        decoder = live_decoder(bench.session, (1,))
    store, late = FrameStore(decoder), FrameStore(Decoder())
    for one in (store, late):
        for data in (bytes(2), bytes(8), bytes(8), bytes(2), bytes(7)):
            one.take(Frame(0x181, data, timestamp_s=1.0))
    late.know(decoder)
    for one in (store, late):
        (event,) = one.events
        assert event.text.startswith("0x181: the frame has ")
        assert event.bad
