"""What was not read after the last thing that could have changed it is not called done, nor stored."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.simulated_faults import Fault
from tests.faults.matrix import NODE, Run, snapshot, stored_pdos
from tests.faults.sequences import SEQUENCES, Start
from tests.process import documents, dvtcli

FOUND = Start(operational=False, modified=False)
TPDO1, TPDO2, RPDO1 = (Pdo.parse(name) for name in ("tpdo1", "tpdo2", "rpdo1"))
MAP = "map tpdo1 6041 606C --cob-id 0x1A1 --sync 1"
#: TPDO2 of the generic device, disabled, as some device makes it when TPDO1 is enabled
ALTERED = "1801:01:0xC0000281"


def bench(folder: Path, *faults: str, family: str = "generic") -> Run:
    return Run.of(family, FOUND, [Fault.parse(text) for text in faults], folder)


@pytest.mark.parametrize("family", ["generic", "gen4", "tmcm", "roboteq"])
@pytest.mark.parametrize("fault", ["reset-after-read@{}=0", "reset-at-read@{}=0.05"])
@pytest.mark.parametrize("answer", range(1, 6))
def test_a_restart_during_the_read_back_is_no_success(tmp_path: Path, family: str, fault: str, answer: int) -> None:
    run = bench(tmp_path, fault.format(answer), family=family)
    before = snapshot(run.device)
    code, record = run.session(SEQUENCES[family]["map-tpdo"])
    assert code == 1
    (error,) = record.errors
    assert error.state == "rolled_back"
    assert "restarted while TPDO1 was changed" in error.text
    assert snapshot(run.device) == before


def test_several_pdos_are_all_read_back_after_the_last_restart(tmp_path: Path) -> None:
    run = bench(tmp_path, "reset-after-read@8=0")
    before = snapshot(run.device)
    code, record = run.session(["clear tpdo1 tpdo2"])
    assert (code, record.errors[0].state) == (1, "rolled_back")
    assert snapshot(run.device) == before


def test_a_lost_answer_alone_makes_it_look_again(tmp_path: Path) -> None:
    run = bench(tmp_path)
    held = run.node().pdo(TPDO1)
    assert run.session([MAP])[0] == 0
    assert run.node().pdo(TPDO1) != held


@pytest.mark.parametrize("fault", [f"alters@7={ALTERED}", "alters@7=1801:01:0x00000299"])
def test_a_device_that_alters_another_pdo_did_not_do_what_was_planned(tmp_path: Path, fault: str) -> None:
    run = bench(tmp_path, fault)
    before = snapshot(run.device)
    code, record = run.session([MAP])
    assert code == 1
    (error,) = record.errors
    assert (error.place, error.state) == ("1801:01", "rolled_back")
    assert "changed TPDO2" in error.text
    assert snapshot(run.device) == before


def test_one_that_does_so_each_time_is_left_changed_and_says_so(tmp_path: Path) -> None:
    run = bench(tmp_path, f"enable-alters={ALTERED}")
    code, record = run.session([MAP])
    assert code == 7
    assert record.errors[0].state == "left_changed"
    assert "1801:01" in (record.errors[0].why or "")
    journal = run.node().guard
    assert journal is not None
    left = journal.interrupted_journal()
    assert left is not None
    assert {change.label for change in left.plan.changes} == {"TPDO1", "TPDO2"}, "both have to be rolled back"


def test_an_event_timer_moves_no_other_pdo_and_reads_only_their_cob_ids(tmp_path: Path) -> None:
    """They are compared with that of the PDO, which stays enabled."""
    run = bench(tmp_path)
    read: set[tuple[int, int]] = set()
    run.bus.tap(
        lambda frame, sent: read.add((int.from_bytes(frame.data[1:3], "little"), frame.data[3])) if sent else None
    )
    assert run.session(["set tpdo1 --timer 250"])[0] == 0
    others = {(index, sub_index) for index, sub_index in read if Pdo.at(index) not in (TPDO1, None)}
    assert {sub_index for _, sub_index in others} == {1}


@pytest.mark.parametrize(
    ("fault", "lines", "told"),
    [
        ("reset-after-read@20=0", [MAP, "store"], "TPDO1 differs from its verified value"),
        ("corrects@7=0.2", [MAP, "sync --period 20 --count 20", "store"], "TPDO1: COB-ID is 0x"),
        ("alters@7=1A01:01:0x60610008", [MAP, "store"], "TPDO2: 0x1A01 is 6061:00/8 6061:00/8, expected 6041:00/16"),
    ],
)
def test_what_is_no_longer_so_is_not_stored(tmp_path: Path, fault: str, lines: list[str], told: str) -> None:
    run = bench(tmp_path, fault)
    stored = stored_pdos(run.device)
    code, record = run.session(lines)
    assert code in (1, 6)
    assert told in f"{record.errors[-1].text} {record.errors[-1].why}"
    assert stored_pdos(run.device) == stored


def test_force_stores_what_the_device_holds(tmp_path: Path) -> None:
    run = bench(tmp_path, "alters@7=1A01:01:0x60610008")
    code, _ = run.session([MAP, "store --force"])
    assert code == 0
    assert stored_pdos(run.device)[0x1A01, 1] == bytes.fromhex("08006160")


def test_a_reset_that_was_asked_for_takes_what_was_not_stored_and_then_all_may_be_stored(tmp_path: Path) -> None:
    run = bench(tmp_path)
    assert run.session([MAP, "nmt reset-node", "store"])[0] == 0


def test_a_script_whose_node_restarts_between_two_lines_fails() -> None:
    done = dvtcli(
        "--sim", "generic", "--fault", "reset-after-read@7=0.05", "--json", "run", "-",
        stdin="set tpdo1 --timer 100\nsync --period 100 --count 2\nset tpdo2 --timer 100\n",
    )  # fmt: skip
    last = documents(done.stdout)[-1]
    assert (done.returncode, last["error"], last["state"]) == (1, "restarted", "unknown")
    assert "TPDO1" in last["text"]


def test_a_restart_as_the_node_goes_back_to_its_state_is_no_success(tmp_path: Path) -> None:
    """The gate is left at the very end; a node that restarts then has lost what was read back before."""
    run = Run.of("gen4", Start(operational=True, modified=False), [Fault.parse("reset-after-read@9=0")], tmp_path)
    code, record = run.session(["set tpdo1 --timer 5"])
    assert code == 1
    assert record.errors[-1].slug == "restarted"
    assert "TPDO1" in record.errors[-1].text


def test_how_a_node_was_found_counts_for_one_change_only(tmp_path: Path) -> None:
    """A store, and a change that was refused, claim the node, too: what they found must start nothing later."""
    run = Run.of("generic", Start(operational=True, modified=False), [], tmp_path)
    code, record = run.session(["map tpdo1 6041", "store", "nmt reset-node", "set tpdo1 --timer 7"])
    assert code == 0, [str(error) for error in record.errors]
    assert run.device.state is NmtState.PRE_OPERATIONAL


@pytest.mark.parametrize("family", ["gen4", "tmcm"])
@pytest.mark.parametrize("answer", range(1, 9))
def test_what_needs_no_store_is_read_again_if_the_node_restarts_behind_its_read_back(
    tmp_path: Path, family: str, answer: int
) -> None:
    fault = Fault.parse(f"reset-at-read@{answer}=0.05")
    run = Run.of(family, Start(operational=True, modified=False), [fault], tmp_path)
    events: list[str] = []

    def note(frame: Frame, sent: bool) -> None:
        if sent and frame.can_id == 0x600 + NODE and frame.data[:4] == b"\x40\x17\x10\0":
            events.append("read")
        elif not sent and frame.can_id == 0x700 + NODE and frame.data == b"\0":
            events.append("boot-up")

    run.bus.tap(note)
    code, record = run.session(["write 1017 150"])
    assert code or "boot-up" not in events or events[-1] == "read", record
