"""doctor says what is well, what is missing and the next step; its exit code is that of the first failure."""

from __future__ import annotations

import os
from itertools import count
from pathlib import Path
from typing import Any

import can
import pytest

from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench
from tests.cli.commands.bus import Wire
from tests.process import ROOT, documents, environment, run
from tests.small_disk import fill, on_small_disk
from tests.surroundings import homes, kept_in

pytestmark = pytest.mark.drawn(5, "doctor")

_NUMBERS = count(1)


def checks(ran_document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    assert ran_document["schema"] == "dvtcli.doctor/1"
    return {check["check"]: check for check in ran_document["checks"]}


def doctor(folder: Path, *words: str, **variables: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit code and checks of a doctor in a process of its own, in *folder*."""
    done = run([*words, "doctor", "--json"], cwd=folder, env=environment() | {"HOME": str(folder)} | variables)
    document, *errors = documents(done.stdout)
    assert document["healthy"] == (done.returncode == 0)
    assert [error["exit_code"] for error in errors] == [done.returncode] * bool(done.returncode)
    return done.returncode, checks(document)


def test_a_simulated_node_is_well(tmp_path: Path) -> None:
    code, found = doctor(tmp_path, "--sim", "gen4", "--journal", str(tmp_path / "kept"))
    assert code == 0
    assert {check["verdict"] for check in found.values()} == {"ok"}
    assert 'node 1 "Gen4" answers; gen4.eds' in found["node"]["text"]
    assert "python-can" in found["packages"]["text"]


def test_what_the_chosen_interface_lacks_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "libcanlib.so").write_bytes(b"no library" * 100)
    folders = {"LD_LIBRARY_PATH": str(tmp_path / "broken")}
    _, found = doctor(tmp_path, "-i", "kvaser", "-c", "0", **folders)
    assert found["drivers"]["verdict"] == "warn"
    assert found["drivers"]["hint"].startswith("for kvaser: Kvaser's CANlib cannot be loaded")
    assert doctor(tmp_path, "--sim", "gen4", **folders)[1]["drivers"]["verdict"] == "ok"


def test_each_setting_is_told_with_where_it_was_said(tmp_path: Path) -> None:
    (tmp_path / "dvtcli.toml").write_text('sim = ["gen4"]\ntimeout = 1.5\n')
    _, found = doctor(tmp_path, "-q", DVTCLI_ASCII="1")
    text = found["settings"]["text"]
    file = tmp_path / "dvtcli.toml"
    for said in (f"sim = gen4 ({file})", f"timeout = 1.5 ({file})", "(DVTCLI_ASCII)", "quiet = True (option)"):
        assert said in text
    assert str(tmp_path / "dvtcli.toml") in text

    (tmp_path / "dvtcli.toml").unlink()
    (tmp_path / "can.conf").write_text("[default]\ninterface = virtual\nchannel = doctor\n")
    code, found = doctor(tmp_path)
    assert code == 0
    assert "interface = virtual (~/can.conf)" in found["settings"]["text"]
    assert found["bus"]["text"] == "virtual:doctor opened, chosen by ~/can.conf"
    assert found["traffic"]["verdict"] == "warn"


def test_nothing_configured_is_a_warning_with_the_next_step(tmp_path: Path) -> None:
    code, found = doctor(tmp_path)
    assert code == 0
    assert found["bus"]["verdict"] == "warn"
    assert "--sim" in found["bus"]["hint"]


def bringing(folder: Path, package: str = "line-gateway", **functions: str) -> str:
    """A PYTHONPATH with a *package* that brings ways to a bus: *functions* by name, `_` for `-`."""
    info = folder / f"{package.replace('-', '_')}-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Name: {package}\nVersion: 1.2\n")
    rows = [f"{name.replace('_', '-')} = {function}\n" for name, function in functions.items()]
    (info / "entry_points.txt").write_text("[dvtcli.bus]\n" + "".join(rows))
    return os.pathsep.join([str(folder), str(ROOT)])


def transports(folder: Path, **functions: str) -> dict[str, dict[str, Any]]:
    """The checks of such a package, by its names."""
    done = run(
        ["doctor", "--json"], cwd=folder,
        env=environment() | {"HOME": str(folder), "PYTHONPATH": bringing(folder, **functions)},
    )  # fmt: skip
    (document,) = documents(done.stdout)
    assert done.returncode == 0
    assert not [one for one in document["checks"] if one["check"] == "interface" and one["text"].startswith("none")
                and one["verdict"] != "ok"]  # fmt: skip
    return {one["text"].split()[0]: one for one in document["checks"] if one["check"] == "transport"}


def test_ways_to_a_bus_of_other_packages_are_listed(tmp_path: Path) -> None:
    (tmp_path / "broken_way.py").write_text("import no_such_package\n")
    (tmp_path / "leaving_way.py").write_text("import os\nos._exit(9)\n")
    found = transports(
        tmp_path, line_gateway="tests.bus.line_gateway:open_bus", broken="broken_way:open_bus",
        leaving="leaving_way:open_bus", number="tests.bus.line_gateway:NET", virtual="tests.bus.line_gateway:open_bus",
    )  # fmt: skip
    well = found.pop("line-gateway")
    assert well["verdict"] == "ok"
    assert well["text"] == "line-gateway  of line-gateway 1.2: tests.bus.line_gateway:open_bus"
    assert {one["verdict"] for one in found.values()} == {"warn"}
    assert "cannot be loaded: ModuleNotFoundError: No module named 'no_such_package'" in found["broken"]["text"]
    assert "pip check" in found["broken"]["hint"]
    assert "its process ended with 9" in found["leaving"]["text"]
    assert "TypeError: it is not a function" in found["number"]["text"]
    assert "python-can has an interface of this name" in found["virtual"]["hint"]


def test_of_two_packages_with_one_name_it_is_said_which_is_opened(tmp_path: Path) -> None:
    (tmp_path / "broken_way.py").write_text("import no_such_package\n")
    bringing(tmp_path, "other-gateway", line_gateway="broken_way:open_bus", alone="tests.bus.line_gateway:open_bus")
    found = transports(tmp_path, line_gateway="tests.bus.line_gateway:open_bus")
    assert found["alone"]["verdict"] == "ok"
    twice = found["line-gateway"]
    opened, never = twice["text"].split("; never opened: ")
    assert twice["verdict"] == "warn"
    both = {"line-gateway 1.2: tests.bus.line_gateway:open_bus", "other-gateway 1.2: broken_way:open_bus"}
    first = opened.removeprefix("line-gateway  of ").partition(";")[0]
    assert {first, never.removeprefix("that of ")} == both
    package = first.partition(":")[0]
    assert twice["hint"] == f"-i line-gateway opens that of {package}: uninstall the wrong package"
    chosen = run(
        ["--json", "-i", "line-gateway", "-c", "nowhere", "read", "1000"], cwd=tmp_path,
        env=environment() | {"HOME": str(tmp_path), "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
    )  # fmt: skip
    assert ("no_such_package" in chosen.stdout) == ("broken_way" in first)


def test_no_package_brings_a_way_to_a_bus(tmp_path: Path) -> None:
    _, found = doctor(tmp_path)
    assert "transport" not in found


def test_a_bus_that_does_not_open_and_a_silent_node_fail(tmp_path: Path) -> None:
    code, found = doctor(tmp_path, "-i", "nosuch")
    assert (code, found["bus"]["verdict"]) == (5, "fail")
    code, found = doctor(tmp_path, "-i", "virtual", "-c", "doctor", "-n", "9")
    assert (code, found["node"]["verdict"]) == (5, "fail")
    assert found["terminal"]["verdict"] == "ok"


def test_a_broken_profile_and_a_folder_that_is_none_fail(tmp_path: Path) -> None:
    own = kept_in(tmp_path) / "profiles"
    own.mkdir(parents=True)
    (own / "mine.toml").write_text("not a profile")
    code, found = doctor(tmp_path, **homes(tmp_path))
    assert (code, found["profiles"]["verdict"]) == (4, "fail")
    (own / "mine.toml").unlink()
    (tmp_path / "file").touch()
    code, found = doctor(tmp_path, "--journal", str(tmp_path / "file" / "below"))
    assert (code, found["state"]["verdict"]) == (6, "fail")
    assert f"{tmp_path / 'file'} is not used: it is a file, not a folder" in found["state"]["text"]


@pytest.mark.parametrize("kept", ["journals", "home"])
def test_a_full_disk_is_told_and_if_the_journals_may_be_on_another_one(tmp_path: Path, kept: str) -> None:
    disk = tmp_path / "disk"
    given = {"journal": str(disk / "kept")} if kept == "journals" else {}

    def full() -> None:
        os.environ.update(homes(tmp_path if kept == "journals" else disk))
        (disk / "kept" / "journals").mkdir(parents=True)
        for name in ("locks", "changes"):
            (kept_in(disk) / name).mkdir(parents=True)
        fill(disk)
        with Bench(("gen4",), given) as bench:
            ran = bench.run("doctor --json")
        state = checks(ran.document)["state"]
        assert (ran.code, state["verdict"]) == (1, "fail"), state
        assert "No space left on device" in state["text"]
        assert str(disk) in state["text"]
        assert ("--journal DIR" in state["hint"]) is (kept == "journals")

    if wrong := on_small_disk(disk, full):
        pytest.fail(wrong)


def test_what_a_killed_process_left_is_told_and_harms_nobody(tmp_path: Path) -> None:
    journals = tmp_path / "journals"
    journals.mkdir()
    left = [journals / name for name in ("tmpabcd1234", "virtual_x-5.json.abcd1234.tmp", f"{'ab' * 16}.whole")]
    for path in left:
        path.touch()
    _, found = doctor(tmp_path, "--journal", str(tmp_path))
    assert found["state"]["verdict"] == "ok"
    assert all(path.name in found["state"]["text"] for path in left)
    assert found["journals"]["verdict"] == "ok"


def test_an_interrupted_change_is_told(tmp_path: Path) -> None:
    (tmp_path / "journals").mkdir()
    (tmp_path / "journals" / "virtual_x-5.json").write_text("{}")
    _, found = doctor(tmp_path, "--journal", str(tmp_path))
    assert found["journals"]["verdict"] == "warn"
    assert found["journals"]["hint"] == "recover finishes it"


def test_what_is_heard_on_a_bus() -> None:
    with Wire(unknown(1, "gen4")) as wire, Bench((), wire.options) as bench:
        assert bench.run("nmt preop").code == 0
        found = checks(bench.run("doctor --json").document)
        assert found["bus"]["verdict"] == "ok"
        assert found["heartbeats"]["text"] == "received from node 1"
        assert "it has no EDS" in found["node"]["text"]


def test_no_adapter_is_missed_where_the_bus_needs_none() -> None:
    with Bench((), {"interface": "virtual", "channel": f"doctor-{next(_NUMBERS)}"}) as bench:
        found = bench.run("doctor --json").document["checks"]
    assert not [one for one in found if one["text"] == "none was found on this machine" and one["verdict"] != "ok"]


def test_error_frames_fail_with_what_they_mean() -> None:
    channel = f"doctor-{next(_NUMBERS)}"
    bus = can.Bus(channel, interface="virtual", ignore_config=True)
    with Bench((), {"interface": "virtual", "channel": channel}) as bench:
        assert bench.session.network.bus.name == f"virtual:{channel}"
        task = bus.send_periodic(can.Message(arbitration_id=0x040, is_error_frame=True, data=bytes(8)), 0.01)
        try:
            ran = bench.run("doctor")
        finally:
            task.stop()
            bus.shutdown()
    assert ran.code == 5
    (line,) = [line for line in ran.stdout.splitlines() if "traffic" in line]
    assert line.startswith("FAIL")
    assert "bus-off" in ran.stdout
