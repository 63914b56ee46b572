"""Whatever is typed wrong is one clear error with the right exit code, and the device stays as it was."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy


@pytest.fixture(scope="module")
def gen4() -> Iterator[Bench]:
    with Bench(("gen4",)) as bench:
        yield bench


WRONG = [
    # objects
    ("map tpdo1 5FFF:0", 1, "0x5FFF is not in gen4.eds"),
    ("map tpdo1 6C01:40", 1, '6C01 "Analogue inputs" has 00, 01'),
    ("map tpdo1 statusward", 2, "map tpdo1 statusword`?"),
    ("map tpdo1 6041/8", 1, "only 8 were requested"),
    ("map tpdo1 6041/32", 1, "has 16 bits, 32 were requested"),
    ("map tpdo1 6041/65", 2, "a length in bits, 1..64"),
    ("map tpdo1 6041/x", 2, "a length in bits, 1..64"),
    ("map tpdo1 1018:1", 1, "is not mappable"),
    ("map tpdo1 606C 606C 6041", 1, "80 bits, at most 64 fit"),
    ("map tpdo1 dummy/16", 1, "a TPDO cannot skip bits"),
    ("map rpdo1 dummy/65", 2, "1..64"),
    ("map rpdo1 6041", 1, "cannot be an RPDO's target"),
    ("map rpdo1 60FF 60FF", 1, "is mapped twice"),
    ("read 5FFF", 1, "0x06020000"),
    ("read 6041:1", 1, "0x06090011"),
    ("read 9", 2, "no object is named '9'"),
    ("read 0x60411", 2, "an index has four hexadecimal digits"),
    ("read 0x6041:zz", 2, "an index has four hexadecimal digits"),
    ('read ""', 2, "the word is empty"),
    ('read "Statusword', 2, "a quote is not closed"),
    ("read 6041 --as u65", 2, "types are bool"),
    # COB-IDs
    ("map tpdo1 6041 --cob-id 201", 2, "0x201?"),
    ("map tpdo1 6041 --cob-id 0x80201", 2, "is an extended CAN-ID"),
    ("map tpdo1 6041 --extended", 2, "--cob-id CAN_ID says which"),
    ("set tpdo1 --extended", 2, "--cob-id CAN_ID says which"),
    ("set tpdo1 --cob-id auto --extended", 2, "--cob-id CAN_ID says which"),
    ("map tpdo1 6041 --cob-id 0x80201 --extended", 1, "11-bit CAN-IDs only"),
    ("map tpdo1 6041 --cob-id 0xC0000201", 2, "bits 29..31 (extended, RTR, valid) have options"),
    ("map tpdo1 6041 --cob-id -0x201", 2, "is not a COB-ID"),
    ("map tpdo1 6041 --cob-id 0x080", 1, "is SYNC"),
    ("map tpdo1 6041 --cob-id 0x081", 1, "this node's EMCY"),
    ("map tpdo1 6041 --cob-id 0x281", 1, "already used by TPDO2"),
    ("map tpdo1 6041 --cob-id 0x701", 1, "restricted by CiA 301: heartbeats"),
    ("map tpdo1 6041 --no-rtr", 1, "needs bit 30 (no RTR) clear"),
    # numbers
    ("map tpdo1 6041 --type 245", 1, "is reserved for a TPDO"),
    ("map tpdo1 6041 --type 256", 2, "0…255"),
    ("map tpdo1 6041 --type 0x100", 2, "0…255"),
    ("map tpdo1 6041 --type 1e1", 2, "is not a number"),
    ("map tpdo1 6041 --sync 0", 2, "1…240"),
    ("map tpdo1 6041 --sync 1 --event", 2, "exclude each other"),
    ("map tpdo1 6041 --inhibit 0.05", 2, "not a multiple of 0.1 ms"),
    ("map tpdo1 6041 --inhibit -1", 2, "not within"),
    ("map tpdo1 6041 --inhibit nan", 2, "not a time in milliseconds"),
    ("map tpdo1 6041 --timer 40000", 1, "32767"),
    ("map tpdo1 6041 --timer 70000", 2, "not within"),
    ("set tpdo1 --sync-start 3", 1, "has no SYNC start value"),
    ("write 60FF 99999999999", 2, "does not fit INTEGER32"),
    ("write 60FF abc", 2, "is not a number"),
    ("write 6041 1", 1, "is ro"),
    ("write 2000:1 5Ω --as vs", 2, "'Ω' is not one of the characters"),
    ("write 6040 6 --as u32", 1, "2 bytes, not 4"),
    ("write 1017 1,5s", 2, "with a decimal point: 1.5s"),
    ("write 1017 1,5", 2, "0 ms to 65535 ms"),
    ("write 1017 1.5 s", 2, 'a blank in quotes: "1.5 s"'),
    ('write 6040 "enable operation"', 2, "enable operation is 0x000F"),
    ("write 1001 current", 2, "no error; or the number"),
    ("objects velocity actual", 2, 'a blank in quotes: "velocity actual"'),
    ("explain 999#00", 2, "is above 0x7FF"),
    ("write 6040 -1", 2, "does not fit UNSIGNED16"),
    # PDOs
    ("map tpdo9 6041", 1, "it has tpdo1…tpdo5"),
    ("map tpdo513 6041", 2, "1..512"),
    ("map tpdo0 6041", 2, "1..512"),
    ("map pdo1 6041", 2, "is not a PDO"),
    ("map tpdo1", 2, "Missing argument"),
    ("set tpdo1", 2, "nothing to set"),
    ("enable tpdo3", 1, "an empty PDO cannot be enabled"),
    ("enable 1:tpdo1 2:tpdo1", 2, "several nodes"),
    ("pdo 128:tpdo1", 2, "1…127"),
    ("pdo tpdo1 tpdo2", 2, "give one PDO"),
    ("clear", 2, "Missing argument"),
    # raw writes meet the guards of the command for it
    ("write 1800:1 0x181701", 1, "frozen while the PDO is enabled"),
    ("write 1800:3 5", 1, "cannot change while the PDO is enabled"),
    ("write 1800:4 1", 1, "is not in gen4.eds"),
    ("write 1A00:0 0", 1, "while the PDO is enabled"),
    ("write 1A00:1 0x60410010", 1, "while the PDO is enabled"),
    ("write 1010:1 1", 1, "takes 'save' only"),
    ("write 1011:1 save", 1, "takes 'load' only"),
    # files, nodes, words
    ("run nofile.dvt", 2, "No such file"),
    ("run tests", 2, "Is a directory"),
    ("verify nofile.dcf", 2, "neither a PDO nor a file"),
    ("eds check nofile.eds", 2, "No such file"),
    ("eds show tests/cli/commands/program/help_examples.toml", 4, "is not an EDS"),
    ("save nowhere/x.dvt", 2, ""),
    ("nmt sleep", 2, "'start', 'stop'"),
    ("nmt start 128", 2, "1…127"),
    ("node 0", 2, "1…127"),
    ("store 128", 2, "1…127"),
    ("store 2", 1, "it has no 0x1010:02"),
    ("sync --count 0", 2, "1…100000"),
    ("require identity vendor=0x1F", 6, "another device"),
    ("require identity colour=1", 2, "vendor="),
    ("undo", 2, "nothing to undo"),
    ("restore", 6, "--yes"),
    ("verify --frame", 2, "nothing to compare"),
    ("bogus", 2, "unknown command 'bogus'"),
    ("mpa tpdo1 6041", 2, "did you mean `dvtcli --sim gen4 map tpdo1 6041`?"),
    ("map tpdo1 6041 -Z", 2, "-Z"),
    ("map tpdo1 6041 --inhibt 3", 2, "--inhibit"),
    ("pdo --sim gen4", 2, "give it at the start of dvtcli"),
    ("pdo -n 5", 2, "give it at the start of dvtcli"),
    ("pdo --timeout 0", 2, "0.001…600"),
    ("help bogus", 2, "unknown command"),
]


@pytest.mark.drawn(12)
@pytest.mark.parametrize(("line", "code", "text"), WRONG, ids=[line for line, _, _ in WRONG])
def test_one_clear_error_and_the_device_unchanged(gen4: Bench, line: str, code: int, text: str) -> None:
    before = gen4.run("pdo --all --json").document
    ran = gen4.run(line)
    assert ran.code == code, ran.stderr
    assert text in ran.stderr
    assert ran.stderr.count("error: ") == 1
    assert ran.stderr.startswith("error: ")
    assert ran.stdout == ""
    assert "Traceback" not in ran.stderr
    if code in (1, 6):
        assert "unchanged: nothing was written" in ran.stderr
    assert gen4.run("pdo --all --json").document == before


@pytest.mark.parametrize(("line", "code", "text"), WRONG, ids=[line for line, _, _ in WRONG])
def test_the_same_error_as_a_document(gen4: Bench, line: str, code: int, text: str) -> None:
    if "Z" in line or '"Statusword' in line:
        pytest.skip("what cannot be parsed has no options of its own")
    document = gen4.run(f"{line} --json")
    if document.stdout == "":  # click stopped before it read --json
        assert code == document.code == 2
        return
    error = document.document
    assert error["schema"] == "dvtcli.error/1"
    assert error["exit_code"] == code
    assert error["state"] == "unchanged"
    assert {"error", "node", "object", "file", "abort", "text", "hint"} <= error.keys()
    assert error["object"] is None or re.fullmatch("[0-9A-F]{4}:[0-9A-F]{2}", error["object"])
    assert error["file"] is None or error["object"] is None
    if error["error"] == "rules":
        assert error["object"] is not None
    assert document.stderr == ""


def test_a_decimal_sub_index_gets_the_hint() -> None:
    with Bench(("tests/cli/commands/many.eds",)) as bench:
        for line in ("read 2000:10", "map tpdo1 2000:10", "write 2000:10 1"):
            ran = bench.run(line)
            assert ran.code == 1
            assert "sub-indices are hexadecimal: decimal 10 is 2000:0A" in ran.stderr


def test_a_node_that_is_not_there_is_no_answer() -> None:
    with Bench(("gen4@1",), {"node": 9, "timeout": 0.05}) as bench:
        for line in ("pdo", "read 1000", "map tpdo1 6041", "store"):
            ran = bench.run(line)
            assert ran.code == 5
            assert "node 9 did not answer" in ran.stderr
            assert "hint" in ran.stderr


@pytest.mark.parametrize("lines", [("read 1017", "recover --accept --finish"), ("recover --accept --finish",)])
def test_an_option_stands_behind_the_place_of_its_line(lines: tuple[str, ...]) -> None:
    with Bench(("gen4",), {"yes": True}) as bench:
        assert bench.run(lines[-1]).stderr.startswith("error: --accept and --finish: they exclude each other")
        said = f"test.dvt:{len(lines)}: error: --accept and --finish: they exclude each other"
        assert bench.script(*lines).stderr.startswith(said)
        assert bench.script("read 1017 --timeout 700").stderr.startswith("test.dvt:1: error: --timeout 700: a time-out")


def test_what_is_typed_for_a_name_that_is_not_known_says_the_bus() -> None:
    with Bench(("gen4",)) as bench:
        for line in ("read 9", "write 9 1", "map tpdo1 9"):
            ran = bench.run(line)
            assert ran.stderr.startswith("error: no object is named '9' in gen4.eds\n")
            assert "`dvtcli --sim gen4 objects TEXT` searches the dictionary" in ran.stderr


@pytest.mark.parametrize("sim", ["nofamily", "gen4@0", "gen4@128", "gen4@x", "@"])
def test_a_wrong_simulation_is_a_usage_error(sim: str) -> None:
    with Bench((sim,)) as bench:
        ran = bench.run("pdo")
        assert ran.code == 2
        assert "error: " in ran.stderr


def test_neither_bus_nor_node_says_what_to_do() -> None:
    with Bench(()) as bench:
        ran = bench.run("pdo")
        assert ran.code in (2, 5)
        assert "--sim" in ran.stderr


@heavy
@pytest.mark.parametrize("described", [True, False])
def test_a_pdo_parameter_of_another_length_is_refused_also_without_a_file(described: bool) -> None:
    with Wire(device("generic")) as wire:
        options = {**wire.options, "eds": str(family_eds("generic")) if described else None}
        with Bench((), options) as bench:
            for line, abort in [
                ("write 1800:1 0x1FFFFFFFFF --as u64", "0x06070012"),
                ("write 1800:1 1 --as u8", "0x06070013"),
                ("write 1800:2 1 --as u32", "0x06070012"),
                ("write 1A00:1 1 --as u8", "0x06070013"),
                ("write 1A00:0 0x1FF --as u16", "0x06070012"),
                ('write 1800:1 "" --as os', "0x06070013"),
            ]:
                ran = bench.run(f"{line} --json")
                assert ran.code == 1, (line, ran.stdout, ran.stderr)
                assert [found["rule"] for found in ran.document["findings"]] == ["length"], line
                assert ran.document["abort"] == abort, line
                forced = bench.run(f"{line} --json --force")
                assert (forced.code, forced.document["abort"]) == (1, abort), line


def test_a_file_is_no_object() -> None:
    with Bench() as bench:
        no_eds = "tests/cli/commands/program/help_examples.toml"
        for line, file in [(f"eds show {no_eds}", "help_examples.toml:1"), ("run nofile.dvt", "nofile.dvt")]:
            error = bench.run(f"{line} --json").document
            assert (error["object"], error["file"]) == (None, file), line


def test_an_error_about_many_pdos_names_a_few() -> None:
    with Bench(("generic",), {"fault": ("silent@10",), "timeout": 0.05}) as bench:
        ran = bench.run("clear all")
        assert ran.code == 7
        assert "TPDO1, TPDO2, TPDO3 and 5 more of node 1 could not be rolled back" in ran.stderr.splitlines()[0]
    with Bench(("generic",)) as bench:
        assert bench.run("clear all").code == 0
        ran = bench.run("enable tpdo1 tpdo2 tpdo3 tpdo4 rpdo1")
        assert ran.code == 1
        assert "TPDO1, TPDO2, TPDO3 and 2 more not changed" in ran.stderr.splitlines()[0]
