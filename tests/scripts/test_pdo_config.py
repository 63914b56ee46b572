"""The main script: default logging TPDOs, run in real processes on simulated nodes."""

from __future__ import annotations

import re

import pytest

from tests.process import ROOT, SCRIPTS, documents, dvtcli

SCRIPT = SCRIPTS / "pdo_config.dvt"
TEXT = SCRIPT.read_text("utf-8")
ARGV = ("--sim", "gen4", "run", "scripts/pdo_config.dvt")


def test_it_runs_and_warns_that_nobody_produces_sync() -> None:
    done = dvtcli(*ARGV)
    assert done.returncode == 0, done.stderr
    assert "warning: no known node produces SYNC" in done.stderr
    assert "0x1006:00  Communication cycle period = 20000" in done.stdout
    assert "0x1005:00  COB-ID SYNC message = 128" in done.stdout


def test_a_node_that_produces_sync_brings_no_warning() -> None:
    done = dvtcli("--sim", "gen4", stdin="write 1005 0x40000080\n" + TEXT)
    assert done.returncode == 0, done.stderr
    assert "no node produces SYNC" not in done.stderr
    assert "node 1  produces SYNC" in done.stdout


def test_pdo_as_the_last_line_lists_what_was_set() -> None:
    done = dvtcli("--sim", "gen4", stdin=TEXT + "pdo\n")
    assert done.returncode == 0, done.stderr
    listed = [line.split() for line in done.stdout.splitlines() if re.match(r"  TPDO\d ", line)]
    assert [row[:6] for row in listed] == [
        [f"TPDO{number}", f"0x{can_id:X}", "enabled", "1", "every", "SYNC"]
        for number, can_id in enumerate((0x181, 0x281, 0x381, 0x481), 1)
    ]


def test_the_frames_are_packed_and_hold_what_a_log_needs() -> None:
    done = dvtcli("--sim", "gen4", "--json", stdin=TEXT + "pdo\n")
    rows = [row for row in documents(done.stdout)[-1]["pdos"] if row["pdo"].startswith("tpdo") and row["enabled"]]
    assert len(rows) >= 4
    for row in rows:
        assert (row["transmission_type"], row["inhibit_ms"], row["event_timer_ms"]) == (1, 0.0, 0)
        assert 32 <= row["bits"] <= 64
        assert all(entry["start_bit"] % 8 == 0 and entry["bits"] % 8 == 0 for entry in row["mapping"])
    mapped = {entry["object"] for row in rows for entry in row["mapping"]}
    assert mapped >= {"5100:01", "5100:02", "5100:04", "606C:00", "6077:00", "6041:00", "6800:01", "2620:00", "6C01:01"}
    assert "2220:00" not in mapped


def test_it_says_the_same_as_documents() -> None:
    found = documents(dvtcli(*ARGV, "--json").stdout)
    assert [document["schema"] for document in found] == [
        "dvtcli.require/1", *["dvtcli.change/1"] * 4, "dvtcli.value/1", "dvtcli.value/1", "dvtcli.sync-check/1",
        "dvtcli.verify/1",
    ]  # fmt: skip
    assert found[-2]["produced"] is False
    assert found[-1]["equal"] is True


def test_the_frames_come_on_every_sync() -> None:
    done = dvtcli("--sim", "gen4", "--json", stdin=TEXT + "nmt start\nsync --count 3 --period 5\n")
    assert done.returncode == 0, done.stdout
    frames = documents(done.stdout)[-1]["frames"]
    assert [(frame["cob_id"], frame["count"]) for frame in frames] == [
        (0x181, 3), (0x281, 3), (0x381, 3), (0x481, 3)
    ]  # fmt: skip
    assert [len(bytes.fromhex(frame["data"])) for frame in frames] == [8, 7, 8, 6]


def test_twice_is_as_good_as_once() -> None:
    done = dvtcli("--sim", "gen4", stdin=TEXT + TEXT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("is already as requested; nothing was written.") == 4


def test_a_dry_run_says_what_it_would_write_and_leaves_the_node() -> None:
    done = dvtcli(*ARGV, "--dry-run")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("dry run:") == 4


@pytest.mark.parametrize("family", ["generic", "tmcm", "roboteq"])
def test_another_makers_device_is_left_alone(family: str) -> None:
    done = dvtcli("--sim", family, "run", str(SCRIPT), "--json")
    assert done.returncode in (2, 6), done.stdout
    assert all(document["schema"] != "dvtcli.change/1" for document in documents(done.stdout))


def test_it_explains_store_and_does_not_do_it() -> None:
    commands = [line.split()[0] for line in TEXT.splitlines() if line and not line.startswith("#")]
    assert commands[-1] == "verify"
    assert "store" not in commands
    assert "store --prove" in TEXT
    assert SCRIPT.is_relative_to(ROOT / "scripts")


def test_its_header_counts_the_frames_it_sets_up() -> None:
    header = TEXT.partition("require identity")[0].replace("\n#", "")
    assert len(re.findall(r"^map tpdo\d", TEXT, re.M)) == 4
    assert "sends four TPDOs" in header
    assert "the four frames below" in header
    assert "five" not in header
