"""The DVT's words on simulated nodes: their answers, their number rules, and that they are the commands' functions."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.cli.dvt.words import WORDS, index, value_bytes
from tests.cli.commands.bench import Bench
from tests.process import environment, run

REMAP = [
    "sdo_wnx 1 0x1800 1 0x80000181",
    "sdo_wnx 1 0x1800 2 0x01",
    "sdo_wnx 1 0x1A00 0 0x00",
    "sdo_wnx 1 0x1A00 1 0x606C0020",
    "sdo_wnx 1 0x1A00 2 0x60410010",
    "sdo_wn 1 0x1A00 0 2 1",
    "sdo_wnx 1 0x1800 1 0x00000181",
]


def test_a_whole_remap_by_single_writes_is_taken_and_undone() -> None:
    with Bench() as bench:
        before = bench.run("pdo --all --json").document
        for line in REMAP:
            ran = bench.run(line)
            assert (ran.code, ran.stdout) == (0, "OK\n"), (line, ran.stderr)
        (tpdo1,) = bench.run("pdo tpdo1 --json").document["pdos"]
        assert [entry["object"] for entry in tpdo1["mapping"]] == ["606C:00", "6041:00"]
        assert (tpdo1["enabled"], tpdo1["transmission_type"]) == (True, 1)
        assert bench.run("undo --all").code == 0
        assert bench.run("pdo --all --json").document == before


def test_an_abort_is_exit_code_1_with_its_reason_and_a_document() -> None:
    with Bench() as bench:
        ran = bench.run("sdo_rnx 1 0x5FFF 0")
        assert (ran.code, ran.stdout) == (1, "Abort 0x06020000\n")
        assert "5FFF" in ran.stderr
        document = bench.run("sdo_wnx 1 0x1800 1 0x00000201 --json").document
        assert (document["schema"], document["word"], document["node"]) == ("dvtcli.dvt/1", "sdo_wnx", 1)
        assert document["answer"] == "Abort 0x06090030"
        assert document["reasons"]


def test_a_silent_node_is_a_timeout() -> None:
    with Bench() as bench:
        ran = bench.run("sdo_rnx 9 0x1018 1 --timeout 0.05")
        assert (ran.code, ran.stdout) == (5, "Timeout\n")


def test_values_are_read_in_hex_and_in_decimal() -> None:
    with Bench() as bench:
        assert bench.run("sdo_rnx 1 0x1018 1").stdout == "0x0000001E\n"
        assert bench.run("sdo_rn 1 0x1018 1").stdout == "30\n"
        assert bench.run("sdo_wn 1 0x60FF 0 -1500 4").stdout == "OK\n"
        assert bench.run("sdo_rn 1 0x60FF 0").stdout == "-1500\n"
        assert bench.run("sdo_rnx 1 24831 0").stdout == "0xFFFFFA24\n"


def test_map_in_tpdo_appends_then_takes_a_disabled_one_and_does_nothing_twice() -> None:
    with Bench() as bench:
        assert bench.run("locate_tpdo 1 0x6800 1").stdout == "not mapped\n"
        assert bench.run("map_in_tpdo 1 0x6800 1").stdout == "OK\n"
        assert bench.run("locate_tpdo 1 0x6800 1").stdout == "TPDO1 0x181 bit 16\n"
        held = bench.run("pdo --all --json").document
        assert bench.run("map_in_tpdo 1 0x6800 1").stdout == "OK\n"
        assert bench.run("pdo --all --json").document == held
        assert bench.run("map_in_tpdo 1 0x6C01 1 0x381").stdout == "OK\n"
        assert bench.run("locate_tpdo 1 0x6C01 1").stdout == "TPDO3 0x381 bit 0\n"
        (tpdo3,) = bench.run("pdo tpdo3 --json").document["pdos"]
        assert (tpdo3["transmission_type"], tpdo3["inhibit_ms"], tpdo3["event_timer_ms"]) == (1, 0.0, 0)


def test_clear_all_pdos_empties_and_disables() -> None:
    with Bench() as bench:
        assert bench.run("clear_all_pdos 1").stdout == "OK\n"
        rows = bench.run("pdo --all --json").document["pdos"]
        assert not any(row["enabled"] or row["mapping"] for row in rows)


def test_store_and_a_typed_signature_are_the_command_s_store(tmp_path: Path) -> None:
    with Bench() as bench:
        assert bench.run("map tpdo1 606C").code == 0
        assert bench.run("sdo_wnx 1 0x1010 1 0x65766174").stdout == "Abort 0x08000020\n"
        assert bench.session.node().unstored
        assert bench.run("sdo_wnx 1 0x1010 1 0x65766173").stdout == "OK\n"
        assert not bench.session.node().unstored
        assert bench.run("nmt reset-node").code == 0
        (tpdo1,) = bench.run("pdo tpdo1 --json").document["pdos"]
        assert [entry["object"] for entry in tpdo1["mapping"]] == ["606C:00"]
        refused = bench.run("sdo_wnx 1 0x1011 1 0x64616F6C")
        assert refused.code == 6, "restore is asked about, as with the command"
        assert bench.run("sdo_wnx 1 0x1011 1 0x64616F6C --yes").stdout == "OK\n"


def test_lg_logs_in_and_out_with_the_passcode_from_the_environment(tmp_path: Path) -> None:
    lines = "lg 1 4\nsdo_rn 1 0x5000 1\nlg 1 0\nsdo_rn 1 0x5000 1\n"
    environment_ = environment() | {"DVTCLI_PASSCODE": "0x4444"}
    done = run(["--sim", "gen4-locked"], stdin=lines, env=environment_)
    assert (done.returncode, done.stdout) == (0, "OK\n4\nOK\n0\n"), done.stderr
    wrong = environment_ | {"DVTCLI_PASSCODE": "48879"}
    done = run(["--sim", "gen4-locked", "lg", "1", "4"], env=wrong)
    assert (done.returncode, done.stdout) == (1, "Abort 0x08000000\n")
    assert "48879" not in done.stderr


def test_fpo_brings_a_node_there_and_back() -> None:
    with Bench() as bench:
        assert bench.run("fpo 1 op").stdout == "OK\n"
        assert bench.run("node --json").document["nodes"][0]["state"] == "OPERATIONAL"
        assert bench.run("fpo").stdout == "OK\n"
        assert bench.run("node --json").document["nodes"][0]["state"] == "PRE-OPERATIONAL"


def test_the_node_may_be_left_out_before_a_word() -> None:
    with Bench() as bench:
        assert bench.run("fpo op").stdout == "OK\n"
        assert bench.run("node --json").document["nodes"][0]["state"] == "OPERATIONAL"
        assert "the state is pre or op" in bench.run("fpo nowhere").stderr


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("sdo_rnx 1 1800 1", "0x1800 write the 0x"),
        ("sdo_wnx 1 0x1800 1 0x201", "3 digits are not possible"),
        ("sdo_wn 1 0x1017 0 1000", "width in bytes"),
        ("sdo_wn 1 0x1017 0 70000 2", "does not fit"),
        ("sdo_rnx 1 0x1018", "Missing argument"),
        ("sdo_rnx 200 0x1018 1", "1…127"),
        ("fpo 1 start", "pre or op"),
        ("sdo_wnxx 1 2 3", "did you mean `sdo_wnx`"),
        ("SDO_RNX 1 0x1018 1", "did you mean `sdo_rnx 1 0x1018 1`?"),
    ],
)
def test_what_is_not_understood_is_said_before_anything_is_sent(line: str, says: str) -> None:
    with Bench() as bench:
        ran = bench.script("nmt preop", line)
        assert ran.code == 2
        assert says in ran.stderr
        assert "test.dvt:2" in ran.stderr
        assert ran.stdout == ""


def test_the_digits_give_the_width() -> None:
    assert value_bytes("0x00", None) == b"\0"
    assert value_bytes("0x00000201", None) == b"\x01\x02\0\0"
    assert value_bytes("1", 4) == b"\x01\0\0\0"
    assert index("6144") == 0x1800


def test_dry_run_holds_for_words() -> None:
    with Bench() as bench:
        before = bench.run("pdo --all --json").document
        tried = bench.run("map_in_tpdo 1 0x6C01 1 --dry-run")
        assert tried.stdout == "OK\n"
        assert "nothing was written to the bus" in tried.stderr
        assert bench.run("pdo --all --json").document == before


def test_the_changes_of_words_are_saved_as_a_script_that_runs(tmp_path: Path) -> None:
    with Bench() as bench:
        for line in REMAP:
            assert bench.run(line).code == 0
        wanted = bench.run("pdo --all --json").document
        assert bench.run(f"save {tmp_path}/saved.dvt").code == 0
    with Bench() as other:
        assert other.run(f"run {tmp_path}/saved.dvt").code == 0
        assert other.run("pdo --all --json").document == wanted


@pytest.mark.parametrize("name", list(WORDS))
def test_help_explains_every_word(name: str) -> None:
    with Bench() as bench:
        assert name in bench.run("help dvt").stdout
        assert bench.run(f"help {name}").code == 0


def test_the_menu_offers_words_to_who_begins_one_and_the_nodes_behind_it() -> None:
    from prompt_toolkit.completion import CompleteEvent
    from prompt_toolkit.document import Document

    from dvtcli.cli.prompt.full_line import LineCompleter

    with Bench(("gen4@1", "gen4@12")) as bench:
        bench.run("node 1")
        completer = LineCompleter(bench.session)

        def offered(line: str) -> list[str]:
            return [item.text for item in completer.get_completions(Document(line), CompleteEvent())]

        assert offered("sdo_w")[:2] == ["sdo_wnx", "sdo_wn"]
        assert not set(offered("")) & (set(WORDS) - {"store"})
        assert offered("sdo_rnx ") == ["1", "12"]
        assert offered("map_in_tpdo 12") == ["12"]
