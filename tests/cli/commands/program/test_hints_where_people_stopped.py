"""What is said where people stopped: the next step, and never one that is refused, too."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import device, unknown
from tests.cli.commands.bench import Bench
from tests.process import dvtcli
from tests.virtual_time import VirtualTimeBus


def test_a_file_takes_the_bytes_of_one_node() -> None:
    with Bench((), {"node": (1, 3), "profile": "generic"}, VirtualTimeBus([device(1), device(3)])) as bench:
        ran = bench.run("read 1008 -o all.bin")
        ran.failed(2, "read 1:1008 -o")
        assert "take several" not in ran.stderr
        assert bench.run("read 1:1008 -o one.bin").code in (0, 1)  # not every device has a name


@pytest.mark.parametrize("line", ["-n 1,5 read 1017", "--node 5 read 1017"])
def test_a_node_in_front_of_a_line_is_told_how(line: str) -> None:
    with Bench() as bench:
        ran = bench.run(line)
        ran.failed(2, "`node 5` selects")
        assert bench.run("read 1:1017").code == 0


def test_text_for_what_is_taken_for_a_number() -> None:
    """Without an EDS the type is guessed by the length; that is said with what writes text."""
    with Bench((), {"node": 1, "profile": "generic"}, VirtualTimeBus([unknown(1)])) as bench:
        ran = bench.run("write 6081 abc")
        ran.failed(2, "--as vs writes text")
        assert "--as vs" not in bench.run("write 6081 abc --as u8").stderr
    with Bench(("gen4@1",)) as bench:
        assert "--as vs" not in bench.run("write 1017 abc").stderr, "its EDS says that it is a number"


def test_a_long_value_is_cut_and_says_how_to_have_it_all() -> None:
    from dvtcli.cli.view.answers.value_lines import value_lines
    from dvtcli.cli.view.typed_hints import typed
    from dvtcli.domain.hint import Hint
    from dvtcli.domain.object_scalings import cut_bytes
    from dvtcli.operations.results.values import ValueRead

    assert cut_bytes(bytes(128)).count("00") == 128
    assert cut_bytes(bytes(3000)).endswith("… 3,000 bytes")
    *_, hint = next(value_lines(ValueRead(1, "2007:00", "", bytes(3000), bytes(3000), "os"), 80))
    assert isinstance(hint, Hint)
    assert typed(hint) == "`read 2007:00 -o FILE` has all"


def test_help_network_is_a_topic() -> None:
    with Bench() as bench:
        assert "apply line.yaml" in bench.run("help network").stdout


@pytest.mark.parametrize(("words", "says"), [
    (["--sim", "gen4"], "no command: standard input is empty"),
    (["--sim", "scan"], "`dvtcli --sim gen4 scan`"),
    (["--sim", "gen4", "--sim", "pdo"], "`dvtcli --sim gen4 pdo`"),
])  # fmt: skip
def test_nothing_to_do_is_no_success(words: list[str], says: str) -> None:
    done = dvtcli(*words)
    assert (done.returncode, says in done.stderr, done.stdout) == (2, True, "")
    assert dvtcli(*words, "--json").returncode == 2


def test_an_option_that_other_servers_have_leads_to_this_ones() -> None:
    done = dvtcli("sim", "gen4@1", "--port", "29701")
    assert "did you mean `dvtcli sim gen4@1 --listen 127.0.0.1:29701`?" in done.stderr
    assert "--color" not in done.stderr, "no option whose letters are far"


def test_an_object_with_one_sub_index_is_told_to_the_user() -> None:
    with Bench() as bench:
        ran = bench.run("map tpdo1 606C:1")
        assert (ran.code, "606C has no sub-indices: name it 606C" in ran.stderr) == (1, True)
        assert bench.run("map tpdo1 606C").code == 0


def test_a_near_command_is_a_hint_for_programs_too() -> None:
    document = Bench(options={"format": "json"}).run("mapp tpdo1").documents[0]
    assert document["text"] == "unknown command 'mapp'"
    assert document["hint"] == "did you mean `map`? `help map` shows it"


def test_link_of_a_network_file_leads_to_plan_and_apply() -> None:
    with Bench() as bench:
        ran = bench.run("link net.yaml")
        assert (ran.code, " plan net.yaml` shows" in ran.stderr, " apply net.yaml` makes" in ran.stderr) == (
            2,
            True,
            True,
        )


def test_ranges_of_node_ids() -> None:
    done = dvtcli("--sim", "gen4@5", "--sim", "gen4@7", "-n", "5,7-7", "read", "1017", "--json")
    assert (done.returncode, done.stdout.count('"node":5'), done.stdout.count('"node":7')) == (0, 1, 1)
    done = dvtcli("--sim", "gen4@5", "-n", "9-5", "read", "1017")
    assert (done.returncode, "'9-5' is not a range of node-IDs: 9 is above 5" in done.stderr) == (2, True)
    assert "or 1,5-9, or all" in done.stderr
    with Bench() as bench:
        assert "'5-200'" not in bench.run("explain 185#10 --nodes 1-1").stderr
        assert "'200' is not a node-ID" in bench.run("explain 185#10 --nodes 5-200").stderr


def test_a_pdo_of_many_objects_is_refused_in_a_short_line() -> None:
    with Bench() as bench:
        ran = bench.run("map tpdo1 " + "6041 " * 60)
        assert ran.code == 1
        assert max(map(len, ran.stderr.splitlines())) < 260


def test_a_file_that_ends_in_the_middle_is_named(tmp_path: Path) -> None:
    whole = family_eds("gen4").read_bytes()
    (tmp_path / "cut.eds").write_bytes(whole[:5000])
    (tmp_path / "whole.eds").write_bytes(whole)
    done = dvtcli("--sim", "cut.eds", "pdo", cwd=tmp_path)
    assert re.search(
        r"warning: cut\.eds is cut short: \d+ of \d+ objects .*`dvtcli eds check cut\.eds` lists", done.stderr
    )
    assert "cut short" in dvtcli("--sim", "gen4", "--eds", "cut.eds", "pdo", cwd=tmp_path).stderr
    assert "cut short" not in dvtcli("--sim", "whole.eds", "pdo", cwd=tmp_path).stderr
    nodes = "".join(f"n{number}:\n  node_id: {number}\n  dcf: {{}}.eds\n" for number in (4, 5))
    for name in ("cut", "whole"):
        (tmp_path / "net.yaml").write_text(nodes.format(name, name), "utf-8")
        checked = dvtcli("check", "net.yaml", cwd=tmp_path).stdout
        assert checked.count("net.yaml:3:8: note: cut.eds is cut short: ") == (name == "cut"), checked
        assert checked.count("cut short") == (name == "cut"), "a file that several nodes name is named once"


def test_a_network_file_without_eds_becomes_a_dbc_file_with_a_warning(tmp_path: Path) -> None:
    (tmp_path / "net.yaml").write_text("nodes:\n  a: {node_id: 4, tpdo: {1: {cob_id: 0x184, mapping: [606C/32]}}}\n")
    done = dvtcli("eds", "convert", "net.yaml", "net.dbc", cwd=tmp_path)
    assert done.returncode == 0
    assert "no EDS of node 4: without one, signals have no names, signs or units; `dcf:`" in done.stderr


def test_a_bracket_that_is_not_closed_is_shown_where_it_begins(tmp_path: Path) -> None:
    (tmp_path / "n.yaml").write_text("nodes:\n  a: [1,2\n\n\n")
    done = dvtcli("check", "n.yaml", cwd=tmp_path)
    assert "n.yaml:2:6: error: not YAML: a bracket or brace is not closed" in done.stderr + done.stdout


def _two_names(folder: Path) -> str:
    """An EDS in which two objects have one name."""
    path = folder / "two.eds"
    text = family_eds("generic").read_text("utf-8")
    path.write_text(text.replace("ParameterName=Velocity demand value", "ParameterName=Statusword"), "utf-8")
    return str(path)


def test_a_name_of_two_objects_offers_lines_that_run(tmp_path: Path) -> None:
    with Bench((_two_names(tmp_path),)) as bench:
        for line, word in (
            ("map tpdo1 {}", "statusword"),
            ("map tpdo1 {}", "statusword/16"),
            ("read {}", "statusword"),
        ):
            ran = bench.run(line.format(word))
            ran.failed(2, "'statusword' means 2 objects (6041, 606B); write the index")
            offered = re.findall("`([^`]+)`", ran.stderr)
            lines = [line.format(word.replace("statusword", index)) for index in ("6041", "606B")]
            assert [said.partition(".eds ")[2] for said in offered] == lines
        assert bench.run("map tpdo1 6041").code == 0
        assert bench.run("read 606B").code == 0


@pytest.mark.parametrize(("pdo", "name"), [("tpdo1", "velocity_actual_value"), ("rpdo1", "target_velocity")])
def test_an_unknown_name_is_taken_for_what_such_a_pdo_is_for(pdo: str, name: str) -> None:
    with Bench(("generic",)) as bench:
        ran = bench.run(f"map {pdo} velocity")
        ran.failed(2, f"did you mean {name},")
        assert bench.run(f"map {pdo} {name}").code == 0


@pytest.mark.parametrize("line", ["set tpdo1 --timer 20", "map tpdo1 6041 --timer 20", "set tpdo1 --inhibit 30"])
def test_an_event_timer_below_the_inhibit_time_is_noted_at_once(line: str) -> None:
    with Bench(("generic",)) as bench:
        assert bench.run("set tpdo1 --inhibit 15 --timer 25 --type 255").code == 0
        said = bench.run("set tpdo1 --inhibit 100" if "--timer" in line else "read 1017").stderr
        assert ("timer" in said) == ("--timer" in line)
        ran = bench.run(f"{line} --json")
        assert ran.code == 0
        (finding,) = [one for one in ran.document["findings"] if one["rule"] == "timer-below-inhibit"]
        assert (finding["severity"], finding["place"]) == ("note", "0x1800:05")
        assert "timer-below-inhibit" not in bench.run("set tpdo1 --type 254 --json").stdout
