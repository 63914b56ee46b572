"""SYNC that no node's 0x1005 explains is a note of `plan` and `apply`; one that a node or a master sends is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from dvtcli.domain.ports import Frame
from dvtcli.errors import RuleError
from dvtcli.operations.network.network_files import apply_file, plan_file
from dvtcli.operations.pdos.sync import ShortFrames
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.network.family_file import family_eds
from tests.harness.sample import heavy
from tests.operations.network.bench import device
from tests.surroundings import HOMES
from tests.virtual_time import VirtualTimeBus

FILE = "a: {node_id: 1, tpdo: {1: {event_timer: 40}}}\nb: {node_id: 5}\n"
EXPLAINED = "master: {node_id: 100, sync_period: 20000}\n"


@pytest.fixture(autouse=True)
def own_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in HOMES:
        monkeypatch.setenv(name, str(tmp_path / "home"))


def noted(tmp_path: Path, sender: int, can_id: int = 0x080, *, more: str = "", apply: bool = True) -> tuple[int, ...]:
    """What a plan, and where that is asked `apply`, says where node *sender* of 1, 5 and 9 sends SYNC."""
    made = {node_id: device(node_id, "generic") for node_id in (1, 5, 9)}
    for one in made.values():
        one.download(0x1005, 0, can_id.to_bytes(4, "little"))
    made[sender].download(0x1006, 0, (5_000).to_bytes(4, "little"))
    made[sender].download(0x1005, 0, (1 << 30 | can_id).to_bytes(4, "little"))
    bus = VirtualTimeBus(list(made.values()), simulated=False)
    file = tmp_path / "net.yaml"
    file.write_text(more + FILE)
    with Session(Options(yes=True, journal=str(tmp_path / "files")), open_bus=lambda _options: bus) as session:
        for node_id in (1, 5):
            session.open_network().files.own_eds[node_id] = family_eds("generic")
        answer = apply_file(session, str(file)) if apply else plan_file(session, str(file))
        assert answer.document()["unknown_syncs"] == list(answer.plan.unknown_syncs)
        return answer.plan.unknown_syncs


def test_a_sync_of_nobody_who_is_known_is_noted_by_apply(tmp_path: Path) -> None:
    assert noted(tmp_path, 9) == (0x080,)


@heavy
def test_plan_notes_what_passes_while_it_reads(tmp_path: Path) -> None:
    assert noted(tmp_path, 9, apply=False) == (0x080,)


def test_one_with_another_can_id_is_noted_where_a_node_waits_for_it(tmp_path: Path) -> None:
    assert noted(tmp_path, 9, 0x0A0) == (0x0A0,)


def test_one_with_a_reserved_can_id_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(RuleError, match="node 1: SYNC 0x07A is reserved"):
        noted(tmp_path, 9, 0x07A)


def test_one_of_a_node_is_none(tmp_path: Path) -> None:
    assert noted(tmp_path, 5) == ()


def test_one_of_the_master_of_the_file_is_none(tmp_path: Path) -> None:
    assert noted(tmp_path, 9, more=EXPLAINED) == ()


def test_heartbeats_remote_frames_and_longer_ones_are_no_sync() -> None:
    found = ShortFrames()
    for frame in (
        Frame(0x701, b"\5"), Frame(0x080, b"\0\0"), Frame(0x080, b"", remote=True), Frame(0x080, b"", extended=True)
    ):  # fmt: skip
        found.note(frame, False)
    assert found == ShortFrames()
    found.note(Frame(0x080, b""), True)
    found.note(Frame(0x081, b"\1"), False)
    assert (found.sent, found.received) == ({0x080}, {0x081})
