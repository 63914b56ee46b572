"""Virtual PDOs: listed, tied, untied, undone, saved; and what speaks against it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.simulator.network.family_file import family_eds
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy

#: Sevcon PDO Fundamentals rev 2, 2.2, the stand-alone traction controller: what the objects hold in the end
TRACTION = {
    "3000:00": 1, "3000:01": 0x2020, "3100:00": 0, "3200:00": 1, "3200:01": 0x2400, "3300:00": 4, "3300:01": 0x2121,
    "3300:02": 0x2122, "3300:03": 0x2123, "3300:04": 0x2124, "3400:00": 1, "3400:01": 0x2220,
}  # fmt: skip
#: something else, so that the example has something to do
OTHERWISE = (
    "vpdo motor none", "vpdo digital-out 2 2320", "vpdo analogue-out 1 2401", "vpdo analogue-out 2 2400",
    "vpdo digital-in 1 2129", "vpdo digital-in 3 none", "vpdo digital-in 6 2130", "vpdo analogue-in 1 none",
)  # fmt: skip
EXAMPLE = (
    "vpdo motor 1 2020", "vpdo digital-out none", "vpdo analogue-out none", "vpdo analogue-out 1 line_contactor",
    "vpdo digital-in none", "vpdo digital-in 1 fwd_switch", "vpdo digital-in 2 reverse_switch", "vpdo digital-in 3 fs1",
    "vpdo digital-in 4 seat_switch", "vpdo analogue-in 1 throttle",
)  # fmt: skip


def held(bench: Bench) -> dict[str, int]:
    return {place: bench.run(f"read {place} --json").document["value"] for place in TRACTION}


def run(bench: Bench, *lines: str) -> None:
    for line in lines:
        ran = bench.run(line)
        assert ran.code == 0, (line, ran.stderr)


@heavy
@pytest.mark.parametrize("family", ["gen4", "espac"])
def test_the_note_s_example_from_another_set_up_and_back(family: str) -> None:
    with Bench((family,)) as bench:
        run(bench, *OTHERWISE)
        before = held(bench)
        assert before != TRACTION
        run(bench, *EXAMPLE)
        assert held(bench) == TRACTION
        run(bench, *(["undo"] * len(EXAMPLE)))
        assert held(bench) == before


def test_undo_puts_back_everything_that_was_tied() -> None:
    with Bench() as bench:
        run(bench, *OTHERWISE)
        assert held(bench) != TRACTION
        run(bench, "undo --all")
        assert held(bench) == TRACTION  # as the simulated node leaves its maker


def test_what_was_tied_is_saved_as_lines_that_do_it_again(tmp_path: Path) -> None:
    script = tmp_path / "mine.dvt"
    with Bench() as bench:
        run(bench, *OTHERWISE, f"save {script}")
        wanted = held(bench)
    lines = script.read_text().splitlines()[2:]
    assert lines == list(OTHERWISE)
    with Bench() as bench:
        assert bench.script(*lines).code == 0
        assert held(bench) == wanted


def test_the_listing_has_pins_objects_and_names() -> None:
    with Bench() as bench:
        run(bench, "vpdo digital-in 6 2129")
        (group,) = bench.run("vpdo digital-in --json").document["groups"]
        assert (group["group"], group["object"], group["active"], group["pins"]) == ("digital-in", "3300:00", 6, 12)
        assert group["tied"][0] == {"pin": 1, "object": "2121:00", "name": "Forward switch"}
        assert group["tied"][4] == {"pin": 5, "object": None, "name": ""}
        assert [row["group"] for row in bench.run("vpdo --json").document["groups"]] == [
            "motor", "digital-out", "analogue-out", "digital-in", "analogue-in"
        ]  # fmt: skip
        assert "0x2129" in bench.run("vpdo").stdout


def test_untying_the_last_pins_does_not_count_them() -> None:
    with Bench() as bench:
        run(bench, "vpdo digital-in 3 none")
        assert held(bench)["3300:00"] == 4
        steps = bench.run("vpdo digital-in 4 none --json").document["steps"]
        assert [(step["object"], step["after"]) for step in steps] == [("3300:04", "FF 21"), ("3300:00", "02")]


def test_no_old_value_wakes_up_when_more_pins_count() -> None:
    with Bench() as bench:
        run(bench, "vpdo digital-in none", "vpdo digital-in 3 2129")
        group = bench.run("vpdo digital-in --json").document["groups"][0]
        assert [row["object"] for row in group["tied"]] == [None, None, "2129:00"]


def test_what_is_so_already_writes_nothing() -> None:
    with Bench() as bench:
        ran = bench.run("vpdo digital-in 1 fwd_switch -v")
        assert "nothing was written" in ran.stdout
        assert "<-" not in ran.stderr


@pytest.mark.parametrize(
    ("value", "rules"),
    [("20FF", ["vpdo-range"]), ("2220", ["vpdo-range"]), ("2170", ["vpdo-object"]), ("2129", []), ("none", [])],
)
def test_a_pin_is_tied_to_what_its_group_takes_and_the_device_has(value: str, rules: list[str]) -> None:
    with Bench() as bench:
        ran = bench.run(f"vpdo digital-in 1 {value} --json")
        assert [one["rule"] for one in ran.document["findings"]] == rules
        assert ran.code == (1 if rules else 0)
        assert (held(bench) == TRACTION) is bool(rules)


def test_a_dry_run_ties_nothing() -> None:
    with Bench() as bench:
        assert "dry run" in bench.run("vpdo digital-in 1 2129 --dry-run").stdout
        assert held(bench) == TRACTION


@pytest.mark.parametrize(
    ("line", "code", "text"),
    [
        ("vpdo digital-in 1 2220", 1, "digital-in takes objects 2100-21FE, not 2220"),
        ("vpdo motor 1 2022", 1, "motor takes objects 2020-2021, 2040, 2060, not 2022"),
        ("vpdo digital-in 1 2170", 1, "0x2170 is not in gen4.eds"),
        ("vpdo digital-in 13 2121", 1, "no digital-in pin 13: it has 1…12"),
        ("vpdo digital-in 1", 2, "give the object to link"),
        ("vpdo digital-in 1 5100:1", 2, "a pin is linked to an object"),
        ("vpdo digital-in none 2121", 2, "takes no object"),
        ("vpdo digital-in 0 2121", 2, "a pin"),
        ("vpdo sideways", 2, "sideways"),
    ],
)
def test_what_cannot_be_is_said_before_any_write(line: str, code: int, text: str) -> None:
    with Bench() as bench:
        ran = bench.run(f"{line} -v")
        assert ran.code == code
        assert text in ran.stderr
        assert "written" not in ran.stderr.replace("nothing was written", "")


def test_only_force_sends_what_is_not_published() -> None:
    with Bench() as bench:
        ran = bench.run("vpdo digital-in 1 2170 --force --json")
        assert ran.code == 1
        assert ran.document["why"] == "the device says 12 at 0x5310:00: the value is invalid"
        assert ran.document["state"] == "rolled_back"
        assert held(bench) == TRACTION


def test_the_node_goes_pre_operational_and_back() -> None:
    with Bench(options={"yes": True}) as bench:
        ran = bench.script("nmt start", "vpdo digital-in 1 2129", "read 5110")
        assert ran.code == 0
        assert bench.run("read 5110 --json").document["value"] == 5


def test_a_family_without_virtual_pdos_says_so() -> None:
    with Bench(("tmcm",)) as bench:
        ran = bench.run("vpdo")
        assert ran.code == 1
        assert "has no virtual PDOs" in ran.stderr


PINS = """
drive:
  node_id: 1
  vpdo:
    motor: {1: 2020}
    digital-out: {1: none}
    analogue-out: {1: line_contactor}
    digital-in: {1: fwd_switch, 2: reverse_switch, 3: fs1, 4: seat_switch, 5: none, 6: none}
    analogue-in: {1: throttle}
"""


@heavy
@pytest.mark.parametrize("family", ["gen4", "espac"])
def test_pins_of_a_network_file_are_planned_applied_and_taken_back(family: str, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(PINS)
    with Bench((family,), {"yes": True}) as bench:
        run(bench, *OTHERWISE)
        run(bench, "vpdo analogue-out 2 none")
        before = held(bench)
        shown = bench.run(f"plan {path}").stdout
        assert "~ 0x3300:01  0x2129 -> 0x2121  digital-in pin 1: 2121 " in shown
        assert "~ 0x3300:00  6 -> 4  digital-in: 4 active" in shown
        run(bench, f"apply {path}")
        assert held(bench) == TRACTION | {"3100:00": 2}  # a pin that the file does not name stays active
        assert bench.run(f"diff {path}").code == 0
        run(bench, "undo --all")
        run(bench, *OTHERWISE, "vpdo analogue-out 2 none")
        assert held(bench) == before


def test_a_pin_that_the_file_leaves_alone_stays(tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text("drive: {node_id: 1, vpdo: {digital-in: {2: 2130}}}")
    with Bench(("gen4",), {"yes": True}) as bench:
        before = held(bench)
        run(bench, f"apply {path}")
        assert held(bench) == before | {"3300:02": 0x2130}
        path.write_text("drive: {node_id: 1, vpdo: {digital-in: {4: none}}}")
        run(bench, f"apply {path}")
        assert held(bench) == before | {"3300:02": 0x2130, "3300:04": 0x21FF, "3300:00": 3}
        assert bench.run(f"diff {path}").code == 0


@pytest.mark.parametrize(
    ("pins", "code", "said"),
    [
        ("{digital-inn: {1: 2120}}", 4, "has no 'digital-inn', but motor, digital-out"),
        ("{digital-in: {99: 2120}}", 4, "has no digital-in pin 99: it has 1…"),
        ("{digital-in: {1: nothing_like_it}}", 4, "nothing_like_it"),
        ("{digital-in: {1: 1018:01}}", 4, "a pin is linked to an object"),
        ("{digital-in: {1: 2220}}", 1, "digital-in takes objects 2100-21FE"),
        ("{digital-in: {1: 21FD}}", 1, "is not in gen4.eds"),
    ],
)
def test_pins_of_a_file_that_cannot_be_tied_are_said(pins: str, code: int, said: str, tmp_path: Path) -> None:
    path = tmp_path / "net.yaml"
    path.write_text(f"drive: {{node_id: 1, vpdo: {pins}}}")
    with Bench(("gen4",), {"yes": True}) as bench:
        before = held(bench)
        ran = bench.run(f"apply {path}")
        assert ran.code == code, ran.stderr
        assert said in ran.stderr
        assert held(bench) == before
    with Bench(("generic",)) as bench:
        ran = bench.run(f"plan {path}")
        assert ran.code == 4
        assert "but no virtual PDOs" in ran.stderr


def test_a_group_that_the_device_lacks_leaves_the_others_in_the_list(tmp_path: Path) -> None:
    """As a real Gen4, whose file has no 0x3100."""
    text = family_eds("gen4").read_text("utf-8")
    lacking = re.sub(r"(?ms)^\[3100(?:sub[0-9A-F]+)?\]$.*?(?=^\[)", "", text, flags=re.IGNORECASE)
    (tmp_path / "lacking.eds").write_text(re.sub(r"(?mi)^\d+=0x3100\r?\n", "", lacking), "utf-8")
    with Bench((str(tmp_path / "lacking.eds"),)) as bench:
        ran = bench.run("vpdo")
        assert (ran.code, "digital-in" in ran.stdout) == (0, True), ran.stderr
        assert "lacks digital-out: 0x3100:00 refused: object does not exist" in ran.stderr, ran.stderr
        assert bench.run("vpdo digital-out").code == 1
