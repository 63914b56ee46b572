"""What one dvtcli changed, another one puts back: by the history that is kept of a device, or by its backup.

Real processes on a node behind a socketcand server; the law at the end with sessions of their own on a virtual bus.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dvtcli.device.change.change_history import MOST_CHANGES, ChangeHistory
from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.plan import Plan, Step, ValueChange
from dvtcli.files.user_folders import user_folder
from tests.cli.commands.bench import Bench as Lines
from tests.cli.commands.bus import Wire, device
from tests.recovery.bench import MAP, Bench
from tests.simulator.serve.served import served

pytestmark = pytest.mark.drawn(3, "undo between processes")


def _changes() -> Path:
    return user_folder("state") / "changes"


def files(bench: Bench) -> list[Path]:
    return sorted(_changes().glob(f"*{bench.wire.port}*.json"))


def remembered(bench: Bench) -> int:
    (file,) = files(bench)
    return len(json.loads(file.read_text("utf-8"))["changes"])


def test_each_process_undoes_one_more(bench: Bench) -> None:
    states = [bench.pdos()]
    for words in (MAP, ("set", "tpdo2", "--timer", "70"), ("clear", "tpdo1")):
        assert bench.run(*words)[0] == 0
        states.append(bench.pdos())
    assert remembered(bench) == 3
    (file,) = files(bench)
    assert file.stat().st_mode & 0o777 == 0o600
    states.pop()
    while states:
        code, stdout, stderr = bench.run("undo", "--json")
        assert code == 0, stderr
        assert json.loads(stdout)["verified"] is True
        assert bench.pdos() == states.pop()
    code, _, stderr = bench.run("undo")
    assert code == 2
    assert "nothing to undo" in stderr


@pytest.mark.parametrize("selected", [5, None])
def test_who_changed_nothing_undoes_no_earlier_command(selected: int | None) -> None:
    with Wire(device("generic", 5)) as wire:
        with Lines((), {**wire.options, "node": 5}) as earlier:
            assert earlier.run("write 1017 700").code == 0
        with Lines((), {**wire.options, "node": selected}) as bench:
            for line in ("write 5:1017 700", "set 5:tpdo1 --timer 0"):
                assert "nothing" in bench.run(line).stdout
            for _ in range(2):  # for each of them
                ran = bench.run("undo")
                assert (ran.code, "changed nothing on node 5" in ran.stderr) == (2, True), ran
            assert bench.run("read 5:1017 --json").document["value"] == 700
            assert bench.run("undo").code == 0
            assert bench.run("read 5:1017 --json").document["value"] == 500


def test_without_a_selected_node_it_is_the_last_change_on_the_bus(bench: Bench) -> None:
    before = bench.pdos()
    at = bench.words.index("-n")
    del bench.words[at : at + 2]
    assert bench.run("map", "5:tpdo1", "6041", "606C")[0] == 0
    code, _, stderr = bench.run("undo")
    assert code == 0, stderr
    assert bench.pdos() == before


def test_it_is_refused_where_the_device_holds_something_else(bench: Bench) -> None:
    assert bench.run(*MAP)[0] == 0
    with bench.wire.at_work:
        bench.wire.device.download(0x1800, 5, bytes([33, 0]))
    held, downloads = bench.pdos(), bench.wire.downloads
    code, stdout, _ = bench.run("undo", "--json")
    assert code == 6
    document = json.loads(stdout)
    assert document["state"] == "unchanged"
    assert "event timer is 33" in document["text"]
    assert (bench.pdos(), bench.wire.downloads) == (held, downloads)
    assert remembered(bench) == 1


def test_another_device_with_the_same_serial_number_keeps_its_own_past(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "generic@3") as nodes:
        for node_id in ("1", "3"):
            assert nodes.dvtcli("-n", node_id, "map", "tpdo1", "6041", "606C").returncode == 0
        assert nodes.dvtcli("-n", "3", "undo").returncode == 0
        assert nodes.dvtcli("-n", "3", "undo").returncode == 2
        undone = nodes.dvtcli("-n", "1", "undo", "--json")
        assert (undone.returncode, json.loads(undone.stdout)["writes"]) == (0, 5)
        assert nodes.dvtcli("undo").returncode == 2


def test_a_dry_run_neither_writes_nor_forgets(bench: Bench) -> None:
    assert bench.run(*MAP, "--dry-run")[0] == 0
    assert not files(bench)
    assert bench.run(*MAP)[0] == 0
    held, downloads = bench.pdos(), bench.wire.downloads
    code, stdout, stderr = bench.run("undo", "--dry-run", "--json")
    assert code == 0, stderr
    assert json.loads(stdout)["dry_run"] is True
    assert json.loads(stdout)["writes"] > 0
    assert (bench.pdos(), bench.wire.downloads, remembered(bench)) == (held, downloads, 1)


def test_a_change_that_was_undone_in_its_session_is_not_remembered(bench: Bench, tmp_path: Path) -> None:
    script = tmp_path / "x.dvt"
    script.write_text("map tpdo1 6041 606C\nset tpdo2 --timer 9\nundo\n")
    before = bench.pdos()
    code, _, stderr = bench.run("run", str(script))
    assert code == 0, stderr
    assert remembered(bench) == 1
    assert bench.run("undo")[0] == 0
    assert bench.pdos() == before


def test_a_damaged_file_is_said_and_kept_aside_by_the_next_change(bench: Bench) -> None:
    assert bench.run(*MAP)[0] == 0
    (file,) = files(bench)
    file.write_text('{"schema": "dvtcli.past/1", "changes": [{"node": 5')
    code, _, stderr = bench.run("undo")
    assert code == 4
    assert str(file) in stderr
    assert "undo --backup" in stderr
    before = bench.pdos()
    code, _, stderr = bench.run("set", "tpdo2", "--timer", "70")
    assert code == 0, stderr
    (aside,) = _changes().glob(f"{file.name}.damaged-*")
    assert str(aside) in stderr
    assert bench.run("undo")[0] == 0
    assert bench.pdos() == before


def test_a_change_that_cannot_be_remembered_is_done_all_the_same(bench: Bench) -> None:
    assert bench.run(*MAP)[0] == 0
    (file,) = files(bench)
    file.unlink()
    file.mkdir()
    try:
        code, _, stderr = bench.run("set", "tpdo2", "--timer", "71")
    finally:
        for left in (file, *_changes().glob(f"{file.name}.damaged-*")):
            if left.is_dir():
                left.rmdir()
    assert code == 0, stderr
    assert bench.pdos()[Pdo.parse("tpdo2")].communication.event_timer == 71
    assert not bench.journals()


def test_the_newest_backup_is_put_back(bench: Bench) -> None:
    before = bench.pdos()
    first, second = (before[Pdo.parse(name)].communication.cob_id for name in ("tpdo1", "tpdo2"))
    script = bench.folder / "swap.dvt"
    script.write_text(
        f"set tpdo1 --cob-id 0x6A0\nmap tpdo2 6041 --cob-id {first}\nset tpdo1 --cob-id {second}\nclear rpdo2\n"
    )
    assert bench.run("run", str(script))[0] == 0
    assert bench.pdos() != before
    code, stdout, stderr = bench.run("undo", "--backup", "--json")
    assert code == 0, stderr
    assert bench.pdos() == before
    assert json.loads(stdout)["verified"] is True
    (backup,) = sorted((bench.folder / "backups").glob("*.dvt"))
    assert bench.run("undo")[0] == 0, "putting a backup back is a change, too"
    assert bench.pdos() != before
    stamp = backup.stem[-len("20261122T041120.123456Z") :]
    code, _, stderr = bench.run("undo", "--backup", stamp)
    assert code == 0, stderr
    assert bench.pdos() == before


def test_backups_are_listed_where_none_is_of_that_time(bench: Bench) -> None:
    code, _, stderr = bench.run("undo", "--backup")
    assert code == 2
    assert "no backup of node 5" in stderr
    assert bench.run(*MAP)[0] == 0
    code, _, stderr = bench.run("undo", "--backup", "1999-12-31")
    assert code == 2
    (backup,) = (bench.folder / "backups").glob("*.dvt")
    assert str(backup) in stderr
    held = backup.read_text("utf-8")
    backup.write_text(held.replace("product=0x", "product=0xF"), "utf-8")
    assert bench.run("undo", "--backup")[0] == 2, "it is of another device"


def test_what_is_remembered_is_bounded_and_told_apart_by_identity(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "socketcan:can0")
    drive: dict[str, int | None] = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
    for value in range(MOST_CHANGES + 10):
        step = Step(0x1017, 0, bytes([value, 0]), bytes([value + 1, 0]), "write")
        history.add(Plan(5, (ValueChange(step),)), drive)
    newest = history.newest(5, drive)
    assert newest is not None
    assert newest.plan.steps[0].after == bytes([MOST_CHANGES + 10, 0])
    assert len(json.loads(history.path(5, drive).read_text("utf-8"))["changes"]) == MOST_CHANGES
    assert history.newest(9, drive) is None
    assert history.moved(5, drive) is None
    assert history.moved(9, drive) == newest, "the serial number says that it is the same device with another node-ID"
    assert history.newest(5, drive | {"serial": 5}) is None
    assert ChangeHistory(tmp_path, "socketcan:can1").newest(5, drive) is None
    for nobody in (None, 0, 0xFFFF_FFFF):
        alike = drive | {"serial": nobody}
        history.add(newest.plan, alike)
        assert history.newest(5, alike) is not None
        assert history.newest(6, alike) is None
        assert history.moved(6, alike) is None
    last = history.newest_of_all()
    assert last is not None
    assert last.identity["serial"] == 0xFFFF_FFFF


def test_what_grows_too_large_to_be_read_loses_its_oldest(tmp_path: Path) -> None:
    history = ChangeHistory(tmp_path, "socketcan:can0")
    drive: dict[str, int | None] = {"vendor": 1, "product": 2, "revision": 3, "serial": 4}
    for value in range(4):
        step = Step(0x2000, 0, bytes(600_000), bytes([value]) * 600_000, "write")
        history.add(Plan(5, (ValueChange(step),)), drive)
        newest = history.newest(5, drive)
        assert newest is not None
        assert newest.plan.steps[0].after[0] == value


STEPS = [
    "map tpdo1 606C",
    "map tpdo1 6041 606C --inhibit 1 --timer 5",
    "set tpdo1 --cob-id 0x3A1",
    "disable tpdo1",
    "enable tpdo1",
    "clear tpdo1",
    "clear all",
    "write 1800:2 10",
    "write 1800:5 7",
    "write 1800:1 0x80000190",
    "write 1A00:0 0",
    "write 1A00:1 0x60770010",
    "write 1A00:2 0x60410010",
    "write 1A00:0 2",
    "write 1017 100",
    "undo",
]


@settings(
    max_examples=max(2, settings().max_examples // 10),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@pytest.mark.long
@given(st.lists(st.sampled_from(STEPS), min_size=1, max_size=8))
def test_changes_of_sessions_of_their_own_are_undone_to_the_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory, lines: list[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    with Wire(device("generic")) as wire:

        def run(line: str) -> int:
            with Lines((), {**wire.options, "yes": True}) as session:
                return session.run(line).code

        def held() -> object:
            with Lines((), wire.options) as session:
                sdo = session.session.node().sdo
                return [read_pdo(sdo, pdo) for pdo in present_pdos(sdo, None)], sdo.upload(0x1017, 0)

        before = held()
        codes = [(line, run(line)) for line in lines]
        assert all(code in (0, 1) or (line, code) == ("undo", 2) for line, code in codes), codes
        while (code := run("undo")) == 0:
            pass
        assert code == 2
        assert held() == before


def test_all_in_a_process_of_its_own_is_everything_remembered_of_every_node(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "generic@3") as nodes:
        before = [nodes.dvtcli("-n", node_id, "pdo", "--all", "--json").stdout for node_id in ("1", "3")]
        script = "map 1:tpdo1 6041 606C\nset 3:tpdo2 --timer 40\nset 1:tpdo1 --timer 7\n"
        assert nodes.dvtcli("-n", "1", "run", "-", stdin=script).returncode == 0
        assert nodes.dvtcli("-n", "3", "clear", "tpdo1").returncode == 0
        alone = nodes.dvtcli("undo", "--dry-run").stderr
        assert " to node 3" in alone
        assert "the changes on node 1 are not undone by this: `dvtcli " in alone
        assert "undo --all` undoes them all" in alone
        tried = nodes.dvtcli("undo", "--all", "--dry-run", "--json")
        assert (tried.returncode, json.loads(tried.stdout)["dry_run"]) == (0, True)
        assert "is not rolled back" not in tried.stderr
        undone = nodes.dvtcli("undo", "--all", "--json")
        assert undone.returncode == 0, undone.stdout
        document = json.loads(undone.stdout)
        assert {(one["node"], *one["pdos"]) for one in document["nodes"]} == {(1, "tpdo1"), (3, "tpdo1", "tpdo2")}
        assert document["verified"] is True
        assert [nodes.dvtcli("-n", node_id, "pdo", "--all", "--json").stdout for node_id in ("1", "3")] == before
        assert nodes.dvtcli("undo", "--all").returncode == 2


def test_what_was_changed_from_a_node_is_undone_from_there_and_what_is_newer_elsewhere_is_said(tmp_path: Path) -> None:
    with served(tmp_path, "generic@1", "generic@3") as nodes:
        for words in (("-n", "1", "set", "tpdo1", "--timer", "5"), ("-n", "1", "set", "3:tpdo2", "--timer", "6")):
            assert nodes.dvtcli(*words).returncode == 0
        assert nodes.dvtcli("-n", "3", "set", "tpdo3", "--timer", "7").returncode == 0
        undone = nodes.dvtcli("-n", "1", "undo", "--json")
        document = json.loads(undone.stdout)
        assert (undone.returncode, document["node"], document["pdo"]) == (0, 1, "tpdo1")
        (finding,) = document["findings"]
        assert finding["rule"] == "newer-change"
        assert "node 3 was changed later" in finding["text"]
        assert "-n 3 undo` undoes that" in finding["hint"]
        assert json.loads(nodes.dvtcli("-n", "3", "undo", "--json").stdout)["pdo"] == "tpdo3"
        undone = nodes.dvtcli("-n", "1", "undo", "--json")
        document = json.loads(undone.stdout)
        assert (undone.returncode, document["node"], document["pdo"], document["findings"]) == (0, 3, "tpdo2", [])
        assert nodes.dvtcli("undo").returncode == 2


def test_changes_that_a_reset_has_taken_are_passed_over_together(bench: Bench) -> None:
    before = bench.pdos()
    for timer in ("41", "42", "43"):
        assert bench.run("set", "tpdo2", "--timer", timer)[0] == 0
    with bench.wire.at_work:
        bench.wire.device.restart()
        bench.wire.device.boot_up()
        bench.wire.device.take_outbox()
    assert bench.pdos() == before
    code, stdout, stderr = bench.run("undo")
    assert code == 0, stderr
    assert "nothing was written" in stdout
    assert "what was before the last 3 changes" in stderr
    assert bench.run("undo")[0] == 2


def test_a_change_that_was_overtaken_does_not_block_those_before_it(bench: Bench) -> None:
    """The next step that the refusal names works, and leads to the older changes."""
    assert bench.run("set", "tpdo1", "--timer", "11")[0] == 0
    first = bench.pdos()
    assert bench.run("set", "tpdo2", "--timer", "22")[0] == 0
    with bench.wire.at_work:
        bench.wire.device.download(0x1801, 5, bytes([33, 0]))
    for words in (("undo",), ("undo", "--all")):
        code, stdout, _ = bench.run(*words, "--json")
        assert code == 6
        assert "undo --force`" in json.loads(stdout)["hint"]
    assert bench.run("undo", "--force")[0] == 0
    assert bench.pdos() == first
    assert bench.run("undo")[0] == 0
    assert bench.run("undo")[0] == 2


def test_all_stops_where_somebody_else_changed_something_in_between(bench: Bench) -> None:
    assert bench.run("set", "tpdo2", "--timer", "22")[0] == 0
    with bench.wire.at_work:
        bench.wire.device.download(0x1801, 5, bytes([33, 0]))
    others = bench.pdos()
    for timer in ("44", "55"):
        assert bench.run("set", "tpdo2", "--timer", timer)[0] == 0
    assert bench.run("undo", "--all")[0] == 0
    assert bench.pdos() == others, "what somebody else set is not overwritten"
    assert bench.run("undo", "--all")[0] == 6


def test_what_is_not_remembered_is_not_said_to_be_undone(bench: Bench) -> None:
    _changes().parent.mkdir(parents=True, exist_ok=True)
    _changes().write_text("in the way")
    code, stdout, stderr = bench.run("set", "tpdo2", "--timer", "7")
    assert code == 0, stderr
    assert "cannot be saved for a later undo" in stderr
    assert "In RAM only" in stdout
    assert "undo" not in stdout
    _changes().unlink()
    assert "`undo` reverts it" in bench.run("set", "tpdo2", "--timer", "8")[1]
