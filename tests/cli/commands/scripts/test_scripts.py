"""Scripts: parsed whole, stopped at the first failure, inside one NMT gate, never asking."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dvtcli.domain.ports import Frame
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy


def test_a_malformed_line_stops_the_script_before_its_first_line() -> None:
    with Bench() as bench:
        for wrong, text in [
            ("bogus", "unknown command 'bogus'"),
            ("map tpdo1 6041 --cob-id 201", "0x201?"),
            ("map tpdo1 statusward", "did you mean `map tpdo1 statusword`?"),
            ("map tpdo1 604100", "did you mean `map tpdo1 6041:00`?"),
            ("map tpdo1 decade", "'decade'"),
            ("map tpdo1 6041 --bogus", "--bogus"),
            ('map tpdo1 "6041', "a quote is not closed"),
            ("map tpdo1 6041 --type 300", "0…255"),
            ("run", "Missing argument"),
        ]:
            ran = bench.script("# a comment", "", "map tpdo1 606C", wrong)
            assert ran.code == 2
            assert ran.stderr.startswith(f"error: test.dvt:4: {text.split(' ', 1)[0]}") or text in ran.stderr
            assert "test.dvt:4: " in ran.stderr
            assert ran.stdout == ""
            assert not bench.session.is_open or not bench.session.node().history


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("write 6040 99999", "'99999' for 0x6040:00 (u16): 99999 does not fit UNSIGNED16 (0..65535)"),
        ("write controlword -1", "-1 does not fit UNSIGNED16"),
        ("write 1017 0x10000", "65536 does not fit UNSIGNED16"),
        ("write 1:6040 0x1FFFF", "131071 does not fit UNSIGNED16"),
        ("write 60FF 70000 --as i16", "70000 does not fit INTEGER16"),
        ("run nested.dvt", "nested.dvt:2: '99999' for 0x6040:00"),
    ],
)
@pytest.mark.parametrize("how", [{"sim": ("gen4",)}, {"sim": (), "options": {"eds": "gen4"}}])
def test_a_number_out_of_range_stops_the_script_before_its_first_line(
    line: str, said: str, how: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With --eds no bus is opened: the file alone has the range."""
    monkeypatch.chdir(tmp_path)
    Path("nested.dvt").write_text("read 1000\nwrite 6040 99999\n", "utf-8")
    with Bench(**how) as bench:
        ran = bench.script("map tpdo1 606C", line)
        assert (ran.code, ran.stdout) == (2, "")
        assert said in ran.stderr
        assert not bench.session.is_open


def test_a_number_is_refused_only_if_no_known_node_can_hold_it() -> None:
    """An object that is not in the file, a text, and a number with a unit are checked when their line runs."""
    with Bench(("gen4", "coupler@2")) as bench:
        for line in ("write 1017 65535", "write 2FFF 99999", "write 6040 shutdown", "write 60FF -1500"):
            assert "does not fit" not in bench.script("pdo", line).stderr
        ran = bench.script("pdo", "write 1017 100s")
        assert (ran.code, "TPDO1" in ran.stdout) == (2, True)
    for sim, alone in ((("generic",), True), (("generic", "gen4"), False)):  # gen4 has no 0x6060
        with Bench(sim) as bench:
            ran = bench.script("pdo", "write 6060 128")
            assert (ran.code, "TPDO1" not in ran.stdout) == (2, alone)


def test_an_option_that_chooses_the_bus_is_refused_in_a_line() -> None:
    for option in ("--sim gen4", "-n 5", "-i virtual", "-c 0", "--eds x.eds", "-p gen4", "--bitrate 500000"):
        with Bench() as bench:
            ran = bench.script(f"pdo {option}")
            assert ran.code == 2
            assert "give it at the start of dvtcli" in ran.stderr
            assert "test.dvt:1" in ran.stderr


@heavy
def test_the_first_failing_line_stops_it_and_gives_the_code() -> None:
    with Bench() as bench:
        ran = bench.script("map tpdo1 606C", "read 5FFF", "map tpdo2 606C --json")
        assert ran.code == 1
        assert "test.dvt:2" in ran.stderr
        assert '"schema"' not in ran.stdout


def test_keep_going_ends_with_the_first_failure() -> None:
    with Bench() as bench:
        ran = bench.script("require identity vendor=1", "read 5FFF", "pdo --json", keep_going=True)
        assert ran.code == 6
        assert ran.document["schema"] == "dvtcli.pdo/1"
        assert bench.script("read 5FFF", "require identity vendor=1", keep_going=True).code == 1
        assert bench.script("pdo -q", keep_going=True).code == 0


def test_another_identity_stops_it_before_any_write() -> None:
    with Bench() as bench:
        before = bench.run("pdo --all --json").document
        ran = bench.script("require identity vendor=0x1E product=0x12345678", "map tpdo1 606C", "store")
        assert ran.code == 6
        assert bench.run("pdo --all --json").document == before


def test_exit_ends_a_script_quietly() -> None:
    with Bench() as bench:
        ran = bench.script("pdo tpdo1 --json", "exit", "read 5FFF")
        assert ran.code == 0
        assert ran.document["schema"] == "dvtcli.pdo/1"


def test_comments_continuations_quotes_and_line_ends() -> None:
    with Bench() as bench:
        data = (
            "\ufeff# a comment\r\n\r\nmap tpdo1 606C \\\r\n  6041   # tail\r\n"
            'read "Statusword" --json\r\n# hidden:\u2028bogus\x0bbogus\x85bogus\n'
        ).encode()
        from dvtcli.cli.scripts.script_parse import script_lines

        lines = script_lines(data, "test.dvt")
        assert [(line.number, line.words) for line in lines] == [
            (3, ["map", "tpdo1", "606C", "6041"]),
            (5, ["read", "Statusword", "--json"]),
        ]
        assert bench.script("map tpdo1 606C \\").code == 2


def test_text_that_is_not_utf_8_is_an_invalid_file() -> None:
    from dvtcli.cli.scripts.script_parse import script_lines
    from dvtcli.errors import InputFileError

    with pytest.raises(InputFileError) as caught:
        script_lines(b"pdo\n# caf\xe9\n", "test.dvt")
    assert caught.value.place == "test.dvt:2"
    with pytest.raises(InputFileError):
        script_lines(b"\xff\xfep\0d\0o\0", "test.dvt")


def test_nobody_is_asked_and_the_flag_is_named() -> None:
    for line in ("restore", "verify --frame"):
        with Bench() as bench:
            assert bench.run("map tpdo1 6041 --sync 1").code == 0
            ran = bench.script(line)
            assert ran.code == 6
            assert "--yes" in ran.stderr
            assert bench.script(f"{line} --yes").code == 0


@pytest.mark.parametrize("nested", [False, True])
def test_one_gate_encloses_the_whole_script(nested: bool, tmp_path: Path) -> None:
    """A node in OPERATIONAL goes pre-operational once, and back once at the end."""
    inner = tmp_path / "inner.dvt"
    inner.write_text("map tpdo2 606C --cob-id auto\nmap tpdo4 6077 --cob-id auto --sync 1\n")
    with Bench() as bench:
        assert bench.run("nmt start").code == 0
        sent: list[bytes] = []

        def received(frame: Frame, sent_by_us: bool) -> None:
            if sent_by_us and frame.can_id == 0:
                sent.append(frame.data)

        assert bench.session._network is not None
        bench.session._network.bus.tap(received)
        lines = [f"run {inner}"] if nested else []
        ran = bench.script("map tpdo1 606C --yes", *lines, "map tpdo3 6041 --cob-id auto --yes", "pdo -q")
        assert ran.code == 0, ran.stderr
        assert sent == [b"\x80\x01", b"\x01\x01"]


def test_after_a_failure_the_node_stays_pre_operational() -> None:
    with Bench() as bench:
        assert bench.run("nmt start").code == 0
        ran = bench.script("map tpdo1 606C --yes", "read 5FFF")
        assert ran.code == 1
        assert bench.run("node --json").document["nodes"][0]["state"] == "PRE-OPERATIONAL"


def test_what_was_saved_runs_and_gives_the_same_pdos(tmp_path: Path) -> None:
    lines = [
        "map tpdo1 606C 6041 --sync 3 --inhibit 1.5 --timer 20",
        "map rpdo1 dummy/16 6040 --cob-id 0x3A1",
        "set tpdo2 --timer 100",
        "disable tpdo2",
        "clear rpdo2",
        "map tpdo3 6077 --off --cob-id auto",
        "write 1017 500",
    ]
    saved = tmp_path / "saved.dvt"
    with Bench(("generic",)) as bench:
        for line in lines:
            assert bench.run(line).code == 0, line
        wanted = bench.run("pdo --all --json").document
        assert bench.run(f"save {saved}").code == 0
    with Bench(("generic",)) as other:
        ran = other.run(f"run {saved}")
        assert ran.code == 0, ran.stderr
        assert other.run("pdo --all --json").document == wanted
        assert other.run("read 1017 --json").document["value"] == 500
    with Bench(("gen4",)) as another:
        assert another.run(f"run {saved}").code == 6
    assert "inner" not in saved.read_text()
    assert list(tmp_path.iterdir()) == [saved]


def _pdos_of_both(bench: Bench) -> list[object]:
    found = []
    for node_id in (1, 2):
        assert bench.run(f"node {node_id}").code == 0
        found.append(bench.run("pdo --all --json").document)
    return found


@heavy
def test_what_was_saved_of_several_nodes_goes_back_to_each_of_them(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic@1", "gen4@2")) as bench:
        for line in ("map 2:tpdo1 6041 --sync 1", "map tpdo1 6041 --sync 3", "node 2", "set tpdo2 --timer 70"):
            assert bench.run(line).code == 0, line
        wanted = _pdos_of_both(bench)
        ran = bench.run(f"save {saved}")
        assert ran.code == 0
        assert "node 1" in ran.stdout
        assert "node 2" in ran.stdout
    with Bench(("generic@1", "gen4@2")) as other:
        ran = other.run(f"run {saved}")
        assert ran.code == 0, ran.stderr
        assert _pdos_of_both(other) == wanted
    with Bench(("gen4@1", "generic@2")) as exchanged:
        assert exchanged.run(f"run {saved}").code == 6
        assert not exchanged.session.record.lines


def test_what_was_saved_of_a_selected_node_selects_it(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic@1", "generic@2")) as bench:
        for line in ("node 2", "map tpdo1 6041 --sync 1", "node 1", f"save {saved}"):
            assert bench.run(line).code == 0, line
    assert [line.split()[0] for line in saved.read_text().splitlines()] == ["#", "node", "require", "set"]
    with Bench(("generic@1", "generic@2")) as other:
        before = other.run("pdo 1:tpdo1 --json").document
        assert other.run(f"run {saved}").code == 0
        assert other.run("pdo 1:tpdo1 --json").document == before
        assert other.run("pdo 2:tpdo1 --json").document != {**before, "node": 2}


def test_what_was_saved_keeps_the_parameters_of_a_pdo_that_ends_empty(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic",)) as bench:
        lines = ["clear tpdo3", "set tpdo3 --cob-id 0x6A7", "map tpdo3 6077 --cob-id 0x6A5 --timer 70", "undo"]
        for line in lines:
            assert bench.run(line).code == 0, line
        wanted = bench.run("pdo --all --json").document
        assert bench.run(f"save {saved}").code == 0
    with Bench(("generic",)) as other:
        ran = other.run(f"run {saved}")
        assert ran.code == 0, ran.stderr
        assert other.run("pdo --all --json").document == wanted


def test_what_was_saved_keeps_each_dummy_as_it_was(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic",)) as bench:
        assert bench.run("map rpdo1 0005:00/8 0002:00/8 6040 --cob-id 0x3A1").code == 0
        assert bench.run(f"save {saved}").code == 0
    with Bench(("generic",)) as other:
        ran = other.run(f"run {saved}")
        assert ran.code == 0, ran.stderr
        raws = [other.run(f"read 1600:{number} --json").document["raw"] for number in (1, 2)]
        assert raws == ["08 00 05 00", "08 00 02 00"]


def test_a_change_that_was_undone_is_not_saved(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic",)) as bench:
        for line in ("map tpdo1 606C", "map tpdo2 6041", "clear tpdo2", "undo", "undo", f"save {saved}"):
            assert bench.run(line).code == 0, line
        wanted = bench.run("pdo --all --json").document
        assert [line.split()[0] for line in saved.read_text().splitlines()] == ["#", "require", "map"]
        assert bench.run("undo --all").code == 0
        assert bench.run("save x.dvt").code == 2
    with Bench(("generic",)) as other:
        assert other.run(f"run {saved}").code == 0
        assert other.run("pdo --all --json").document == wanted


def test_an_undo_after_a_store_is_saved_as_a_change_of_its_own(tmp_path: Path) -> None:
    saved = tmp_path / "saved.dvt"
    with Bench(("generic",)) as bench:
        for line in ("map tpdo1 606C", "store", "undo", f"save {saved} --history"):
            assert bench.run(line).code == 0, line
        wanted = bench.run("pdo --all --json").document
    with Bench(("generic",)) as other:
        assert other.run(f"run {saved}").code == 0
        assert other.run("pdo --all --json").document == wanted
        assert other.run("nmt reset-node").code == 0
        assert other.run("pdo tpdo1 --json").document["pdos"][0]["mapping"][0]["object"] == "606C:00"
