"""Small words that were wrong or missing once: labels, hints, places, what stays."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dvtcli.domain.text import ascii_only
from dvtcli.files.eds.reader import parse_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire
from tests.harness.sample import heavy
from tests.process import documents, environment, run


def test_verify_does_not_call_its_rehearsal_a_dry_run(tmp_path: Path) -> None:
    script = tmp_path / "bad.dvt"
    script.write_text("write 1000 5\n")
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"verify {script}")
    assert ran.code == 1
    assert "dry run" not in ran.stderr
    assert "--force" not in ran.stderr, "nothing is sent by verify, forced or not"


def test_a_bus_of_the_settings_is_the_hint_where_none_is_chosen(tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('[bus.bench]\ninterface = "virtual"\nchannel = "b"\n')
    own = environment() | {"HOME": str(tmp_path)}
    done = run(["-n", "1", "pdo"], cwd=tmp_path, env=own)
    assert done.returncode == 5
    assert "--bus bench" in done.stderr
    (found,) = documents(run(["doctor", "--json"], cwd=tmp_path, env=own).stdout)
    bus = next(check for check in found["checks"] if check["check"] == "bus")
    assert "--bus bench" in bus["hint"]


def test_doctor_tells_what_a_projects_file_says_in_vain(tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text("yes = true\n")
    (found,) = documents(run(["doctor", "--json"], cwd=tmp_path, env=environment() | {"HOME": str(tmp_path)}).stdout)
    settings = next(check for check in found["checks"] if check["check"] == "settings")
    assert settings["verdict"] == "warn"
    assert "yes: never taken from a project's file" in settings["text"]
    assert "config.toml" in settings["hint"]


def test_a_folder_is_no_file_to_save_to(tmp_path: Path) -> None:
    with Bench(("gen4",), {"yes": True}) as bench:
        bench.run("set tpdo1 --timer 70")
        ran = bench.run(f"save {tmp_path}")
        assert ran.code == 2
        assert f"{tmp_path} is a folder" in ran.stderr
        assert f"give a file in it, such as {tmp_path}/NAME.dvt" in ran.stderr
        ran = bench.run(f"save {tmp_path}/none/x.dvt")
        assert ran.code == 2
        assert f"no such folder: {tmp_path}/none" in ran.stderr
    assert list(tmp_path.iterdir()) == []


def test_many_changes_are_counted_before_they_are_named() -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run("clear all")
        assert "5 PDOs set (TPDO1, TPDO2, TPDO4 and 2 more): 8 writes" in ran.stdout
        assert "dry run: 5 PDOs would be set (TPDO1, " in Bench(("gen4",)).run("clear all --dry-run").stdout


@pytest.mark.parametrize("fault", ["nonsense", "5:silent@1"])
def test_an_option_of_the_start_is_no_fault_of_a_scripts_line(fault: str) -> None:
    with Bench(("gen4",), {"fault": (fault,)}) as bench:
        ran = bench.script("read 1000")
        assert ran.code == 2
        assert ran.stderr.startswith(f"error: --fault: {fault}")
        assert bench.script("read 1000 --json").document["at"] is None


@heavy
def test_what_a_tcl_script_changed_before_it_was_stopped_is_named(tmp_path: Path) -> None:
    script = tmp_path / "m.tcl"
    script.write_text("dvtcli map tpdo1 6041 606C\ndvtcli read 1000\ndvtcli set tpdo2 --timer 70\nwhile 1 {}\n")
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"run {script} --max-seconds 1")
    assert ran.code == 4
    assert f"state   unchanged since its last command; the changes of {script}:1, {script}:3 stay" in ran.stderr
    assert "before is not" not in ran.stderr


# --- consent to a reset


def two_axes() -> str:
    """The generic drive with a second axis 0x800 further on (CiA 402-2, 6.2)."""
    return family_eds("generic").read_text("utf-8") + (
        "\n[6841]\nParameterName=Statusword 2\nObjectType=0x7\nDataType=0x0006\nAccessType=ro\n"
        "DefaultValue=0x1237\nPDOMapping=1\n"
    )


def test_a_second_axis_that_is_enabled_is_not_reset_unasked(tmp_path: Path) -> None:
    (tmp_path / "two.eds").write_text(two_axes())
    node = StrictDevice(parse_eds(two_axes().encode(), "two.eds").dictionary, load_family("generic"), 1)
    node.set_value(0x6041, 0, b"\x50\x02")
    with Wire(node) as wire, Bench((), {**wire.options, "journal": str(tmp_path)}) as bench:
        for line in ("nmt reset-node", "store --prove"):
            ran = bench.run(line)
            assert ran.code == 6
            assert "node 1 has operation enabled (0x6841 is 0x1237)" in ran.stderr
        node.set_value(0x6841, 0, b"\x50\x02")
        assert bench.run("nmt reset-node").code == 0


@pytest.mark.parametrize("axis", range(8))
def test_require_power_off_looks_at_every_axis_and_names_its_controlword(axis: int, tmp_path: Path) -> None:
    more = "".join(
        f"\n[{0x6041 + 0x800 * further:04X}]\nParameterName=Statusword {further + 1}\nObjectType=0x7\n"
        "DataType=0x0006\nAccessType=ro\nDefaultValue=0x0250\nPDOMapping=1\n"
        for further in range(1, 8)
    )
    text = family_eds("generic").read_text("utf-8") + more
    node = StrictDevice(parse_eds(text.encode(), "eight.eds").dictionary, load_family("generic"), 1)
    node.set_value(0x6041, 0, b"\x50\x02")
    with Wire(node) as wire, Bench((), {**wire.options, "journal": str(tmp_path)}) as bench:
        assert bench.run("require power-off").code == 0
        node.set_value(0x6041 + 0x800 * axis, 0, b"\x37\x06")
        ran = bench.run("require power-off")
        assert ran.code == 6
        assert f"operation enabled (0x{0x6041 + 0x800 * axis:04X} is 0x0637)" in ran.stderr
        assert f"write {0x6040 + 0x800 * axis:04X} 0" in ran.stderr


@pytest.mark.parametrize("line", ["nmt reset-node", "nmt reset-comm all", "store --prove"])
def test_a_simulated_drive_that_was_enabled_here_is_not_reset_unasked(line: str) -> None:
    """As it came up it may be: nobody enabled it, and who rehearses a script shall not get used to --yes."""
    with Bench(("generic",)) as bench:
        assert bench.script("nmt reset-node", "store --prove").code == 0
        for word in (6, 7, 15):
            assert bench.run(f"write 6040 {word}").code == 0
        ran = bench.run(line)
        assert ran.code == 6
        assert "node 1 has operation enabled (0x6041 is " in ran.stderr
        assert bench.run("write 6040 6").code == 0
        assert bench.run(line).code == 0


def test_without_an_eds_what_the_first_reset_took_is_said_too() -> None:
    with Wire(unknown(1)) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.session.node().dictionary is None
        bench.run("map tpdo1 6064")
        bench.run("store")
        bench.run("set tpdo2 --timer 70")
        document = bench.run("restore --prove --json").documents[-1]
        assert (document["proved"], document["lost"]) == (True, ["TPDO2"])


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("MAP tpdo1 6041 --off", "map tpdo1 6041 --off"),
        ("tpdo1", "pdo tpdo1"),
        ("3:TPDO1", "pdo 3:tpdo1"),
        ("read 6041h", "read 6041"),
        ("read 1A00h:01h", "read 1A00:01"),
        ("undo all", "undo --all"),
        ("QUIT", "exit"),
    ],
)
def test_what_people_type_is_what_they_mean(typed: str, meant: str) -> None:
    ran = []
    for line in (typed, meant):
        with Bench(("gen4@1", "generic@3")) as bench:
            bench.run("set tpdo2 --timer 70")
            ran.append(bench.run(line))
    assert ran[0].code == ran[1].code
    first, second = (re.sub(r"[0-9.]+ s\b", "", one.stdout) for one in ran)
    assert first == second


def test_an_object_may_name_its_node() -> None:
    with Bench(("gen4@1", "generic@3")) as bench:
        assert bench.run("write 3:1017 700").code == 0
        assert "= 700" in bench.run("read 3:1017").stdout
        assert "= 700" in bench.run("read 3:producer_heartbeat_time").stdout
        assert "= 700" not in bench.run("read 1017").stdout
        refused = bench.run("read 300:1017")
        assert refused.code == 2
        assert "node-IDs are 1…127" in refused.stderr


def test_a_can_id_in_decimal_gets_its_hexadecimal() -> None:
    with Bench(("gen4",)) as bench:
        assert "0x201 (decimal 513) or 0x513?" in bench.run("map tpdo1 6041 --cob-id 513").stderr
        assert "with 0x; 0x201?" in bench.run("map tpdo1 6041 --cob-id 201").stderr


def test_a_pdo_with_more_words_gets_the_command_for_it() -> None:
    with Bench(("gen4",)) as bench:
        ran = bench.run("tpdo1 6041")
    assert ran.code == 2
    assert "map tpdo1 OBJECT" in ran.stderr


def test_a_store_by_its_number_is_final_in_any_notation(tmp_path: Path) -> None:
    script = tmp_path / "final.dvt"
    script.write_text("write 1010h:01h save\nset tpdo1 --timer 70\n")
    with Bench(("gen4",)) as bench:
        ran = bench.run(f"run {script} --atomic")
    assert ran.code == 2
    assert "final.dvt:1" in ran.stderr


def test_an_unknown_interface_gets_all_that_there_are() -> None:
    ran = run(["-i", "soketcan", "-c", "can0", "scan"])
    assert ran.returncode == 5
    assert "did you mean socketcan?" in ran.stderr
    assert "pcan" in ran.stderr
    assert "slcan" in ran.stderr


@pytest.mark.parametrize("text", ["±0.8 ms", "↑ 3 lines ↓", "1 µs ≤ 2 × 3 – 4"])
def test_ascii_has_a_look_alike_for_what_screens_draw(text: str) -> None:
    assert "?" not in ascii_only(text)
