"""What an earlier dvtcli kept (c8b3f698, November 2026) is still read: journals, history, backups, habits, plans.

`kept_november_2026` is what that commit wrote on simulated nodes; node 5 and node 7 were left in the middle of a change
by a bus that was gone.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from dvtcli.simulator.device.strict_device import StrictDevice
from tests.bus.devices import device
from tests.cli.commands.bench import Bench, beside
from tests.cli.commands.change.test_second_try import stricter
from tests.harness.sample import heavy
from tests.process import dvtcli
from tests.surroundings import HOMES, kept_in

KEPT = Path(__file__).parent / "kept_november_2026"


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The state folder of a user who had that version."""
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "state"))
    folder = kept_in(tmp_path / "state")
    shutil.copytree(KEPT, folder, dirs_exist_ok=True)
    return folder


def interrupted() -> StrictDevice:
    """Node 5 as it was left: TPDO1 off, nothing else of its mapping written yet."""
    made = device(5)
    for index, sub_index, data in (
        (0x1800, 1, "850100C0"), (0x1800, 5, "1E00"), (0x1801, 1, "85020040"), (0x1A01, 1, "08010060"),
        (0x1A01, 2, "10010164"), (0x1A01, 0, "02"), (0x1017, 0, "F401"),
    ):  # fmt: skip
        made.set_value(index, sub_index, bytes.fromhex(data))
    return made


def test_a_journal_is_put_back() -> None:
    left = interrupted()
    with Bench((), {"yes": True, "node": (5,)}, beside([left])) as bench:
        refused = bench.run("set tpdo1 --timer 60")
        assert (refused.code, "recover" in refused.stderr) == (6, True), refused
        ran = bench.run("recover")
        assert ran.code == 0, ran
        assert left.value(0x1800, 1).hex() == "85010040"
        assert bench.run("set tpdo1 --timer 60").code == 0


def test_a_journal_of_a_network_is_put_back() -> None:
    six, seven = device(6), device(7)
    seven.set_value(0x1800, 5, b"\x46\0")
    with Bench((), {"yes": True, "node": (7,)}, beside([six, seven])) as bench:
        ran = bench.run("recover")
        assert ran.code == 0, ran
    assert seven.value(0x1800, 5) == b"\0\0"


def test_the_history_is_taken_back() -> None:
    left = interrupted()
    with Bench((), {"yes": True, "node": (5,)}, beside([left])) as bench:
        assert bench.run("recover").code == 0
        ran = bench.run("undo --all")
        assert ran.code == 0, ran
    assert left.value(0x1800, 5) == b"\0\0"
    assert left.value(0x1017, 0) == device(5).value(0x1017, 0)


@heavy
def test_a_backup_is_read(kept: Path) -> None:
    made = device(5)
    with Bench((), {"yes": True, "node": (5,)}, beside([made])) as bench:
        assert bench.run("recover --accept").code == 0
        assert bench.run(f"compare {kept / 'all.jsonl'}").code == 3
        assert bench.run(f"apply {kept / 'all.jsonl'}").code == 0
        assert made.value(0x1800, 5) == b"\x1e\0"
        (automatic,) = (kept / "backups").glob("virtual_time-5-*.dvt")
        assert bench.run(f"run {automatic}").code == 0
        assert made.value(0x1800, 5) == b"\0\0"


def test_a_plan_is_carried_out(kept: Path) -> None:
    made = device(5)
    made.set_value(0x1800, 5, b"\x1e\0")
    with Bench((), {"yes": True, "node": (5,)}, beside([made])) as bench:
        assert bench.run("recover --accept").code == 0
        ran = bench.run(f"apply {kept / 'plan.json'}")
        assert ran.code == 0, ran
    assert made.value(0x1800, 5) == b"\x46\0"


def test_habits_count() -> None:
    with Bench((), {"yes": True, "node": (1,)}, beside([stricter(type_while_valid=0x06090030)])) as bench:
        (known,) = bench.run("profiles habits --json").document["devices"]
        assert known["off_first"][0]["counts"] is True
        ran = bench.run("set tpdo1 --sync 5")
        assert ran.code == 0, ran
        assert "was refused" not in ran.stdout + ran.stderr


def test_settings_count(kept: Path) -> None:
    shown = dvtcli("doctor", "--json", stdin="")
    (settings,) = (check for check in json.loads(shown.stdout)["checks"] if check["check"] == "settings")
    assert settings["verdict"] == "ok", settings
    for said in ("sim = ", "generic@5", "timeout = 0.2", "yes = True", str(kept / "config.toml")):
        assert said in settings["text"], settings
    assert dvtcli("read", "1018:1").returncode == 0
