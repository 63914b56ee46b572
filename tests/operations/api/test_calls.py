"""The Python API does what the commands do: the same results, the same errors, the same care."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import is_dataclass, replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import can
import pytest
from canopen.sdo import SdoCommunicationError

import dvtcli
from dvtcli import errors
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.profile import Severity
from dvtcli.domain.rules import Finding
from dvtcli.operations import results as room
from dvtcli.operations.api.called_hints import answer_in_calls
from dvtcli.operations.results import NetworkApplied
from dvtcli.results import Changed, Message, Pdo, Progress, Synced
from dvtcli.simulator.network.family_file import family_eds
from dvtcli.testing import Serve
from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy
from tests.posix import SIGKILL
from tests.process import PATIENCE_S, ROOT, environment


def test_a_map_answers_what_the_command_answers() -> None:
    with Bench() as bench:
        ran = bench.run("map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1 --json")
    with dvtcli.simulate("gen4") as bus:
        changed = bus.node().map("tpdo1", "6C01:1", 0x606C, (0x6041, 0), cob_id=0x201, sync=1)
    assert isinstance(changed, Changed)
    assert changed.document() == ran.document


def test_what_was_mapped_is_read_back_and_undone() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        before = node.pdo("tpdo1").config
        node.map("tpdo1", "statusword", "606C/32", cob_id=0x201, event=True, timer_ms=100, inhibit_ms=0.5)
        held = node.pdos()["tpdo1"].config
        assert [entry.object for entry in held.mapping] == ["6041:00", "606C:00"]
        assert held.communication.cob_id.can_id == 0x201
        assert (held.communication.event_timer, held.communication.inhibit_time) == (100, 5)
        assert node.verify()
        node.undo()
        assert node.pdo("tpdo1").config == before


def test_enable_disable_clear_and_set() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        node.disable("tpdo1", "tpdo2")
        assert not any(node.pdo(name).config.enabled for name in ("tpdo1", "tpdo2"))
        node.enable("tpdo1")
        assert node.pdo("tpdo1").config.enabled
        node.set("tpdo1", transmission_type=255, timer_ms=250)
        assert node.pdo("tpdo1").config.communication.event_timer == 250
        node.clear("tpdo1")
        assert node.pdo("tpdo1").config.mapping == ()
        node.undo(everything=True)
        assert node.pdo("tpdo2").config.enabled
        node.clear("all")
        assert not any(row.config.enabled for row in node.pdos())


def test_nmt_of_a_node_that_has_died_is_not_true() -> None:
    with dvtcli.simulate("generic@5", faults=["silent@1"]) as bus:
        node = bus.node(5)
        node.read(0x1000)
        # its first download is its last; canopen asks once and leaves it
        with pytest.raises(SdoCommunicationError):
            node.canopen().sdo.download(0x1017, 0, bytes(2))
        for command in ("start", "stop", "preop"):
            done = node.nmt(command)  # type: ignore[arg-type]
            assert (bool(done), done.states) == (False, ((5, None),))


def test_nmt_is_judged_by_the_state_that_is_seen() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        assert node.nmt("start")
        assert node.identity().state == "OPERATIONAL"
        assert node.nmt("reset-node", yes=True)
    with dvtcli.simulate("gen4", faults=["ignores-nmt"]) as bus:
        assert not bus.node().nmt("start")


@heavy
def test_a_change_of_an_earlier_program_is_recovered(dvtcli_serve: Serve) -> None:
    served = dvtcli_serve("gen4@5")
    killed = """
import dvtcli, os, signal
def kill(step):
    if step.done == 3:
        os.kill(os.getpid(), signal.SIGKILL)
bus = dvtcli.connect(**{settings}, timeout_s={patience_s}, on_progress=kill)
bus.node(5).map("tpdo1", "6041/16", "606C/32")
"""
    with served.connect(timeout_s=PATIENCE_S) as bus:
        before = bus.node(5).pdo("tpdo1").config
        assert bus.node(5).recover(yes=True) is None
    done = subprocess.run(
        [sys.executable, "-c", killed.format(settings=served.settings, patience_s=PATIENCE_S)],
        env=environment(),
        check=False,
    )
    assert done.returncode == -SIGKILL
    with served.connect(timeout_s=PATIENCE_S) as bus:
        node = bus.node(5)
        with pytest.raises(errors.SafetyRefusal, match="interrupted"):
            node.set("tpdo2", event=True)
        with pytest.raises(errors.SafetyRefusal, match="not confirmed: "):
            node.recover()
        assert node.pdo("tpdo1").config != before
        assert node.recover(yes=True)
        assert node.pdo("tpdo1").config == before


def test_read_and_write() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        assert node.read("1018:1").type_name == "u32"
        node.write(0x1017, 700)
        assert node.read((0x1017, 0)).value == 700
        node.write("1017", b"\xe8\x03")
        assert node.read(0x1017, "u16").raw == b"\xe8\x03"


def test_a_scan_finds_the_nodes() -> None:
    with dvtcli.simulate("gen4@5", "tmcm@7") as bus:
        assert [row.node for row in bus.scan()] == [5, 7]
        assert bus.node().node_id == 5


WRONG = {
    "no such PDO": (lambda node: node.map("tpdo9", 0x6041), errors.SdoAborted),
    "no PDO": (lambda node: node.map("pdo1", 0x6041), errors.UsageError),
    "no such object": (lambda node: node.map("tpdo1", "nosuch"), errors.UsageError),
    "no such option": (lambda node: node.set("tpdo1", timr=1), errors.UsageError),
    "two kinds": (lambda node: node.set("tpdo1", sync=1, event=True), errors.UsageError),
    "no CAN-ID": (lambda node: node.set("tpdo1", cob_id=0x2000_0000), errors.UsageError),
    "not a multiple": (lambda node: node.set("tpdo1", inhibit_ms=0.05), errors.UsageError),
    "no index": (lambda node: node.read(0x10000), errors.UsageError),
    "no type": (lambda node: node.read(0x1017, "u17"), errors.UsageError),
    "too large": (lambda node: node.write(0x1017, 0x10000), errors.UsageError),
    "a signature": (lambda node: node.write("1010:1", 1), errors.UsageError),
    "nothing to undo": (lambda node: node.undo(), errors.UsageError),
    "nothing to compare": (lambda node: node.verify(), errors.UsageError),
    "no NMT command": (lambda node: node.nmt("go"), errors.UsageError),
    "nothing to map": (lambda node: node.map("tpdo1"), errors.UsageError),
    "nothing to set": (lambda node: node.set("tpdo1"), errors.UsageError),
    "no PDO to clear": (lambda node: node.clear(), errors.UsageError),
    "no group": (lambda node: node.store("rest"), errors.UsageError),
    "a rule": (lambda node: node.map("tpdo1", *["606C"] * 3), errors.RuleError),
    "the device": (lambda node: node.read(0x2FFF), errors.SdoAborted),
}


@pytest.mark.parametrize(("call", "error"), WRONG.values(), ids=list(WRONG))
def test_what_is_wrong_is_an_error_of_the_commands(call: object, error: type[errors.DvtcliError]) -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        before = [(row.pdo, row.config) for row in node.pdos()]
        with pytest.raises(error) as raised:
            call(node)  # type: ignore[operator]
        assert raised.value.state == "unchanged"
        assert [(row.pdo, row.config) for row in node.pdos()] == before


def test_a_refused_change_is_put_back() -> None:
    with dvtcli.simulate("gen4", faults=["refuse@3=0x06040041"]) as bus:
        node = bus.node()
        before = node.pdo("tpdo1").config
        with pytest.raises(errors.DeviceRefused) as refused:
            node.map("tpdo1", "6041", "606C")
        assert refused.value.state == "rolled_back"
        assert node.pdo("tpdo1").config == before


def test_consent_needs_yes_or_somebody_who_gives_it() -> None:
    asked: list[str] = []

    def no(question: str) -> bool:
        asked.append(question)
        return False

    with dvtcli.simulate("gen4") as bus:
        with pytest.raises(errors.SafetyRefusal, match="not confirmed: ") as refused:
            bus.node().restore()
        assert refused.value.hint == "give yes=True to answer yes"
        assert bus.node().restore(yes=True)
    with dvtcli.simulate("gen4", ask=no) as bus, pytest.raises(errors.SafetyRefusal, match="the answer was no"):
        bus.node().restore()
    assert "restore?" in asked[0]
    with dvtcli.simulate("gen4", ask=lambda _question: True) as bus:
        assert bus.node().restore()


def test_yes_and_force_count_for_one_call() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.restore(yes=True)
        with pytest.raises(errors.SafetyRefusal):
            node.restore()


def test_a_dry_run_works_on_twins_that_remember() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        before = node.pdo("tpdo1").config
        with bus.dry_run():
            assert bus.is_dry_run
            changed = node.map("tpdo1", "6041", "606C")
            assert changed.dry_run
            assert node.pdo("tpdo1").config != before
            assert node.verify()
            with pytest.raises(errors.UsageError), bus.dry_run():
                pass
        assert not bus.is_dry_run
        assert node.pdo("tpdo1").config == before
        with pytest.raises(errors.UsageError, match="nothing to undo"):
            node.undo()


def test_a_dry_run_ends_with_an_error_in_it() -> None:
    with dvtcli.simulate("gen4") as bus:
        with pytest.raises(errors.UsageError), bus.dry_run():
            bus.node().verify()
        assert not bus.is_dry_run


def test_progress_tells_every_step() -> None:
    told: list[Progress] = []
    with dvtcli.simulate("gen4", on_progress=told.append) as bus:
        changed = bus.node().map("tpdo1", "6041", "606C")
    assert [one.step for one in told] == list(changed.plan.steps)
    assert [(one.done, one.total) for one in told] == [(n, len(told)) for n in range(1, len(told) + 1)]


def test_a_call_back_that_raises_ends_the_change_which_is_put_back() -> None:
    def stop(progress: Progress) -> None:
        if progress.done == 3:
            raise ZeroDivisionError

    with dvtcli.simulate("gen4", on_progress=stop) as bus:
        node = bus.node()
        before = node.pdo("tpdo1").config
        with pytest.raises(ZeroDivisionError):
            node.map("tpdo1", "6041", "606C")
        assert node.pdo("tpdo1").config == before


def test_a_call_back_must_not_call_the_bus() -> None:
    with dvtcli.simulate("gen4", on_progress=lambda _: bus.node().pdos()) as bus:
        before = bus.node().pdo("tpdo1").config
        with pytest.raises(errors.UsageError, match="callback"):
            bus.node().map("tpdo1", "6041", "606C")
        assert bus.node().pdo("tpdo1").config == before


@pytest.fixture
def logged() -> Iterator[list[str]]:
    """What a program that keeps a log gets into it."""
    lines: list[str] = []

    class Kept(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    logger, handler = logging.getLogger("dvtcli"), Kept("INFO")
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel("INFO")
    yield lines
    logger.setLevel(before)
    logger.removeHandler(handler)


def test_messages_go_to_the_call_back_and_the_log(logged: list[str]) -> None:
    told: list[Message] = []
    with dvtcli.simulate("gen4", on_message=told.append, faults=["reset@5"]) as bus:
        bus.node().set("tpdo1", event=True, timer_ms=100)
        with pytest.raises(errors.DvtcliError):
            bus.node().map("tpdo2", "6041", "606C")
    assert any("node 1 restarted" in one.text and one.kind == "warning" for one in told)
    assert [one.text for one in told] == logged


def test_nothing_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        node.map("tpdo1", "6041")
        node.store(prove=True)
        with pytest.raises(errors.RuleError):
            node.map("tpdo1", *["606C"] * 3)
    assert capsys.readouterr() == ("", "")


def test_a_closed_bus_says_so_and_closes_twice() -> None:
    bus = dvtcli.simulate("gen4")
    node = bus.node()
    bus.close()
    bus.close()
    with pytest.raises(errors.BusUnavailable, match="closed"):
        node.pdos()
    assert repr(bus) == "<dvtcli bus sim, closed>"


def test_an_eds_is_of_one_node(tmp_path: Path) -> None:
    eds = tmp_path / "mine.eds"
    eds.write_bytes(family_eds("generic").read_bytes())
    with dvtcli.simulate("gen4@1", "generic@2") as bus:
        two = bus.node(2, eds=eds, profile="generic")
        two.pdos()
        assert bus.node(2, eds=eds) is two
        assert bus.node(1).identity().source != two.identity().source
        with pytest.raises(errors.UsageError, match="used before"):
            bus.node(2, eds=family_eds("gen4"))
        with pytest.raises(errors.UsageError, match=r"[Nn]o such file"):
            bus.node(3, eds=tmp_path / "nosuch.eds")


@pytest.mark.parametrize("node_id", [0, 128, "1", None])
def test_a_node_id_is_1_to_127(node_id: object) -> None:
    with dvtcli.connect(interface="virtual", channel="api-ids") as bus, pytest.raises(errors.UsageError):
        bus.node(node_id)  # type: ignore[arg-type]


def test_a_bus_that_does_not_open() -> None:
    with pytest.raises(errors.BusUnavailable, match="cannot open"):
        dvtcli.connect(interface="nosuch", channel="x")
    with pytest.raises(errors.UsageError):
        dvtcli.simulate()
    with pytest.raises(errors.UsageError, match="no such family"):
        dvtcli.simulate("nosuch")


def test_threads_wait_for_their_turn() -> None:
    with dvtcli.simulate("gen4", "tmcm@5") as bus:
        failures: list[BaseException] = []

        def work(node_id: int) -> None:
            try:
                node = bus.node(node_id)
                for milliseconds in (100, 200, 300):
                    node.set("tpdo1", event=True, timer_ms=milliseconds)
                    assert node.verify()
            except BaseException as failed:  # noqa: BLE001 - told by the main thread
                failures.append(failed)

        threads = [threading.Thread(target=work, args=(node_id,)) for node_id in (1, 5, 1, 5)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not failures


@pytest.mark.parametrize("reads", range(14, 24))
def test_a_call_whose_node_restarts_by_its_end_does_not_answer_that_it_is_done(reads: int) -> None:
    with dvtcli.simulate("gen4", faults=[f"reset-after-read@{reads}=0"]) as bus:
        node = bus.node()
        assert node.nmt("start")
        boots = bus._session.wire.boot_ups(1)
        try:
            node.map("tpdo1", "6041", cob_id=0x201, yes=True)
        except (errors.Restarted, errors.DeviceRefused):
            return
        assert bus._session.wire.boot_ups(1) == boots or node.pdo("tpdo1").config.communication.cob_id.can_id == 0x201


@pytest.mark.parametrize("reads", range(1, 20))
def test_what_is_so_already_was_read_in_one_life_of_the_node(reads: int) -> None:
    with dvtcli.simulate("gen4", faults=[f"reset-after-read@{reads}=0"]) as bus:
        node = bus.node()
        cob_id = node.pdo("tpdo1").config.communication.cob_id
        try:
            node.canopen().sdo.download(0x1800, 1, cob_id.disabled().raw.to_bytes(4, "little"))
        except errors.SafetyRefusal:  # it restarted since it was read
            return
        boots = bus._session.wire.boot_ups(1)
        try:
            node.disable("tpdo1", "rpdo1")
        except (errors.Restarted, errors.SafetyRefusal):  # it does not say that it is done
            return
        assert bus._session.wire.boot_ups(1) == boots or not node.pdo("tpdo1").config.enabled


def test_another_threads_call_is_no_part_of_a_dry_run() -> None:
    failed: list[Exception] = []

    def call(node: dvtcli.Node) -> None:
        try:
            node.disable("tpdo1")
        except errors.UsageError as refused:
            failed.append(refused)

    with dvtcli.simulate("gen4") as bus:
        with bus.dry_run():
            thread = threading.Thread(target=call, args=[bus.node()])
            thread.start()
            thread.join()
        assert [str(one) for one in failed] == ["another thread's dry run is running: call again when it has ended"]
        call(bus.node())
        assert not bus.node().pdo("tpdo1").config.enabled


@heavy
def test_what_stood_or_fell_together_is_recovered_on_every_node(dvtcli_serve: Serve) -> None:
    served = dvtcli_serve("gen4@1", "gen4@3")
    killed = f"""
import dvtcli, os, signal
bus = dvtcli.connect(**{served.settings}, timeout_s={PATIENCE_S})
bus._session.group.begin("x.dvt")
bus.node(1).disable("tpdo1")
bus.node(3).disable("tpdo1")
os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", killed], env=environment(), check=False)
    with served.connect(timeout_s=PATIENCE_S) as bus:
        assert not any(bus.node(node_id).pdo("tpdo1").config.enabled for node_id in (1, 3))
        done = bus.node(3).recover(yes=True)
        assert done is not None
        assert done.node == 3
        assert all(bus.node(node_id).pdo("tpdo1").config.enabled for node_id in (1, 3))


@heavy
def test_a_node_that_restarts_while_another_is_recovered_is_put_back_again(
    dvtcli_serve: Serve,
) -> None:
    served = dvtcli_serve("gen4@1", "gen4@3", faults=["3:late@2=2"])
    killed = f"""
import dvtcli, os, signal
bus = dvtcli.connect(**{served.settings}, timeout_s={PATIENCE_S})
bus._session.group.begin("x.dvt")
bus.node(1).set("tpdo1", timer_ms=44)
bus.node(3).disable("tpdo1")
os.kill(os.getpid(), signal.SIGKILL)
"""
    with served.connect(timeout_s=PATIENCE_S) as bus:
        bus.node(1).set("tpdo1", timer_ms=33)
    subprocess.run([sys.executable, "-c", killed], env=environment(), check=False)
    with served.connect(timeout_s=PATIENCE_S) as bus, can.Bus(**served.settings) as other:

        def reset() -> None:
            while (frame := other.recv(PATIENCE_S)) and (frame.arbitration_id, frame.data[0] >> 5) != (0x603, 1):
                pass
            other.send(can.Message(arbitration_id=0, data=[0x81, 1], is_extended_id=False))

        thread = threading.Thread(target=reset)
        thread.start()
        assert bus.node(3).recover(yes=True)
        thread.join()
        assert bus.node(1).pdo("tpdo1").config.communication.event_timer == 33, "lost, and rolled back once more"


def test_a_program_logs_in_and_out() -> None:
    with dvtcli.simulate("gen4-locked") as bus:
        node = bus.node()
        with pytest.raises(errors.RuleError, match="access level"):
            node.map("tpdo1", "606C")
        with pytest.raises(errors.DeviceRefused):
            node.login(0xBEEF)
        done = node.login(0x4444)
        assert (done.level, done.wanted) == (4, 4)
        assert node.map("tpdo1", "606C")
        assert node.login(level=0).level == 0
        with pytest.raises(errors.UsageError, match="passcode"):
            node.login(-1)
        for wrong in ("0x4444", 70_000, True):
            with pytest.raises(errors.UsageError) as refused:
                node.login(wrong)  # type: ignore[arg-type]
            assert str(wrong) not in str(refused.value), "what may be nearly right is not repeated"
        assert "4444" not in bus.script(history=True)


def test_a_program_without_login_says_so() -> None:
    with dvtcli.simulate("generic") as bus, pytest.raises(errors.DvtcliError, match="no login"):
        bus.node().login(1)


def test_the_changes_of_a_program_are_a_script_that_does_them_again(tmp_path: Path) -> None:
    with dvtcli.simulate("gen4", "generic@5") as bus:
        with pytest.raises(errors.UsageError, match="nothing"):
            bus.script()
        bus.node(1).map("tpdo1", "6041", cob_id=0x201)
        bus.node(5).set("tpdo2", timer_ms=40)
        bus.node(5).set("tpdo2", timer_ms=50)
        text, held = bus.script(), bus.node(1).pdo("tpdo1").config
        assert (text.count("tpdo2"), bus.script(history=True).count("tpdo2")) == (1, 2)
    (tmp_path / "done.dvt").write_text(text, encoding="utf-8")
    with Bench(("gen4", "generic@5")) as bench:
        assert bench.run(f"run {tmp_path / 'done.dvt'}").code == 0
        again = bench.session.node(1).pdo(Pdo.parse("tpdo1"))
        assert again == held
        assert bench.session.node(5).pdo(Pdo.parse("tpdo2")).communication.event_timer == 50


def test_sync_answers_what_the_command_answers() -> None:
    with Bench() as bench:
        bench.run("map tpdo1 606C --cob-id 0x201 --sync 1")
        bench.run("nmt start")
        ran = bench.run("sync --count 3 --period 5 --json")
    with dvtcli.simulate("gen4") as bus:
        bus.node().map("tpdo1", "606C", cob_id=0x201, sync=1)
        assert bus.node().nmt("start")
        synced = bus.sync(3, period_ms=5)
    assert isinstance(synced, Synced)
    whole, rows = synced.document(), [frame for frame in ran.document["frames"] if frame["cob_id"] == 0x201]
    assert [(row["pdo"], row["count"]) for row in rows] == [("TPDO1 node 1", 3)]
    assert [frame["cob_id"] for frame in whole["frames"] if frame in rows] == [0x201]
    assert {**whole, "frames": rows} == {**ran.document, "frames": rows}


def test_the_can_id_of_sync_is_what_its_node_says() -> None:
    with dvtcli.simulate("generic", "generic@5") as bus:
        bus.node(5).write("1005", 0x82)
        assert bus.sync().can_id == 0x080
        assert bus.sync(node_id=5).can_id == 0x082
        assert bus.node(5).recover(yes=True) is None
        assert bus.sync().can_id == 0x080, "the node of an earlier call is not selected by it"


@pytest.mark.parametrize(
    "wrong", [{"count": 0}, {"count": True}, {"period_ms": -1}, {"period_ms": 0}, {"period_ms": "20"}, {"node_id": 128}]
)
def test_a_wrong_sync_is_told(wrong: dict[str, Any]) -> None:
    with dvtcli.simulate("generic") as bus, pytest.raises(errors.UsageError, match=next(iter(wrong))):
        bus.sync(**wrong)


@heavy
def test_an_answer_has_a_short_text() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node()
        changed = node.set("tpdo1", timer_ms=100)
        lines = str(changed).splitlines()
        assert lines[0].startswith("Changed(node=1, ")
        assert lines[1:] == ["  1800:05 event timer 100 ms"]
        lines = str(node.pdos()).splitlines()
        assert len(lines) == 1 + len(node.pdos())
        assert lines[1] == "  TPDO1 0x181 enabled, type 255: 6041:00/16"
        for answer in (node.read(0x1000), bus.scan(), node.verify(), node.store(), node.faults(), node.record("1018")):
            assert len(str(answer).splitlines()[0]) < 250


def test_answers_speak_of_calls() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        changed = node.map("tpdo1", "606C")
        assert changed.keep == "`node.store()` keeps it"
        said = Finding("can-id", Severity.NOTE, "1800:01", "taken", None, Hint(Action.SELECT_CAN_ID, why="or {}"))
        noted = replace(changed, findings=(said,))
    assert answer_in_calls(noted).findings[0].hint == "or cob_id='auto'"
    assert answer_in_calls(noted.plan) is noted.plan
    applied = NetworkApplied(None, False, 0.0, keep={1: changed.keep, 5: Hint(Action.STORE, why="keeps it")})  # type: ignore[arg-type]
    assert answer_in_calls(applied).keep[5] == "`node.store()` keeps it"


def test_a_notebook_shows_every_answer_and_its_rows_in_short() -> None:
    """IPython asks the class itself before the ones above it, and takes its repr: every dataclass has one."""
    names = [f"{room.__name__}.{one.name}" for one in iter_modules(room.__path__)]
    kinds = [one for name in names for one in vars(import_module(name)).values() if is_dataclass(one)]
    own = [one for one in kinds if isinstance(one, type) and one.__module__ in names]
    assert len(own) > 60
    assert [one.__name__ for one in own if "_repr_pretty_" not in vars(one)] == []
    pretty = pytest.importorskip("IPython.lib.pretty")
    with dvtcli.simulate("gen4") as bus:
        found, row = bus.scan(), bus.node(1).pdos()[0]
    assert pretty.pretty(found) == str(found)
    assert pretty.pretty(row) == str(row)


def test_a_row_by_itself_is_short() -> None:
    with dvtcli.simulate("gen4") as bus:
        node = bus.node(1)
        rows = node.pdos()[0], node.objects("velocity")[0], bus.scan()[0]
    assert str(rows[0]) == "TPDO1 0x181 enabled, type 255: 6041:00/16"
    assert str(rows[1]).startswith("ObjectRow(object=2020:03, name=Motor drive left.Target velocity left, ")
    for row in rows:
        assert "\n" not in str(row)
        assert repr(row) == f"<{row}>"


def test_every_answer_and_its_plan_are_a_short_line_in_a_python_session() -> None:
    """The interpreter shows the `repr` of what a line returns."""
    with dvtcli.simulate("gen4", "generic@5", ask=lambda _question: True) as bus:
        node = bus.node(1)
        changed = node.map("tpdo1", "6041", "606C")
        planned = bus.plan(ROOT / "examples" / "first.yaml")
        answers = (
            changed, changed.plan, planned, planned.plan, planned.plan.nodes[0], bus.scan(), node.pdos(), node.verify(),
            node.read("6041"), node.store(), bus.check(ROOT / "examples" / "line.yaml"),
            bus.load(ROOT / "examples" / "line.yaml", for_s=0), bus.apply(ROOT / "examples" / "first.yaml"),
            dvtcli.profile("gen4"), bus.lss, node.vpdo(), node.undo(),
        )  # fmt: skip
    assert repr(changed.plan) == "<Plan of node 1: 6 steps of TPDO1>"
    for answer in answers:
        assert "\n" not in repr(answer)
        assert len(repr(answer)) < 300, repr(answer)
