"""A disk that is full from any file operation on, while three nodes are changed: all is as before, or all is done."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.domain.network.network_config import Endpoint
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import BusUnavailable, DvtcliError, LeftChanged, SafetyRefusal
from dvtcli.operations.changes.change import configure
from dvtcli.operations.changes.recover_change import recover
from dvtcli.operations.changes.undo import undo
from dvtcli.operations.network.network_files import apply_file
from dvtcli.operations.plans.link_pdos import link_pdos, unlink_pdos
from dvtcli.operations.session.session import Session
from tests.cli.commands.bench import Bench
from tests.harness.sample import part
from tests.operations.network.bench import CHAIN, Chain
from tests.operations.network.test_network_faults import OPERATIONAL
from tests.operations.network.test_refused_stores import refuse_stores
from tests.small_disk import empty, fill, filled_at, on_small_disk
from tests.surroundings import HOMES

FAMILIES = dict.fromkeys((1, 5, 9), "generic")
PRODUCER, CONSUMERS = Endpoint(1, Pdo.parse("tpdo1")), [Endpoint(one, Pdo.parse("rpdo1")) for one in (5, 9)]


def _file(chain: Chain, *, stores: bool = False, stamp: bool = False) -> str:
    text = "".join(
        f"n{node_id}:\n  node_id: {node_id}\n  store: {str(stores).lower()}\n  stamp: {str(stamp).lower()}\n"
        "  tpdo:\n    1: {transmission: 1}\n"
        for node_id in FAMILIES
    )
    path = chain.folder.parent.parent.parent / "three.yaml"
    path.write_text(text)
    return str(path)


@dataclass(frozen=True)
class Job:
    """What is done on three nodes of *families*, and what was done before; whether that was interrupted, and waits."""

    act: Callable[[Session, Chain], object]
    before: Callable[[Session, Chain], object] = lambda _session, _chain: None
    waits: bool = False
    families: Mapping[int, str] = field(default_factory=lambda: FAMILIES)


def _link(session: Session, _chain: Chain) -> None:
    link_pdos(session, PRODUCER, CONSUMERS)


def _script(*lines: str, stores: bool = False) -> Callable[[Session, Chain], object]:
    """Run *lines*, in which FILE is that of the network, as an atomic script; DvtcliError with its exit code."""

    def act(session: Session, chain: Chain) -> None:
        file = _file(chain, stores=stores, stamp=stores)
        session.close()
        chain.bus._closed = False
        path = chain.folder.parent.parent.parent / "lines.dvt"
        path.write_text("\n".join(lines).replace("FILE", file))
        given = {"yes": True, "journal": str(chain.folder), "node": None}
        with Bench((), given, bus=chain.bus) as bench:
            ran = bench.run(f"run {path} --atomic")
        if ran.code:
            failed = DvtcliError(ran.stderr, state="rolled_back")
            failed.exit_code = ran.code
            raise failed

    return act


def _cut(session: Session, chain: Chain) -> None:
    """`apply` loses the bus with its third write: nothing can be taken back."""
    send, written = chain.bus.send_sdo, 0

    def send_sdo(can_id: int, data: bytes) -> None:
        nonlocal written
        written += data[0] >> 5 == 1
        if written > 2:
            raise BusUnavailable("the bus is gone")
        send(can_id, data)

    vars(chain.bus)["send_sdo"] = send_sdo
    with pytest.raises(LeftChanged):
        apply_file(session, _file(chain))
    del vars(chain.bus)["send_sdo"]


def _unstored(session: Session, chain: Chain) -> None:
    """Two of three nodes refuse to store at the end of `apply`, and would not any more."""
    refuse_stores(chain, (5, 9))
    with pytest.raises(LeftChanged):
        apply_file(session, _file(chain, stores=True, stamp=True))
    refuse_stores(chain, ())


JOBS = {
    "apply": Job(lambda session, chain: apply_file(session, _file(chain))),
    "apply-store": Job(lambda session, chain: apply_file(session, _file(chain, stores=True, stamp=True))),
    "apply-prove": Job(lambda session, chain: apply_file(session, _file(chain, stores=True), prove="reset")),
    "store": Job(
        lambda session, chain: apply_file(session, _file(chain, stores=True), prove="reset"),
        lambda session, chain: apply_file(session, _file(chain)),
    ),
    "link": Job(_link),
    "unlink": Job(lambda session, _chain: unlink_pdos(session, PRODUCER, CONSUMERS), _link),
    "script": Job(
        _script("set 1:tpdo1 --timer 40", "set 5:tpdo1 --timer 40", "set 1:tpdo2 --timer 9", "set 9:tpdo1 --timer 4")
    ),
    "script-gen4": Job(
        _script("map 1:tpdo2 6041 606C", "set 5:tpdo1 --timer 40", "set 1:tpdo1 --timer 40", "disable 9:tpdo1"),
        families=CHAIN,
    ),
    "script-apply": Job(_script("set 1:tpdo2 --timer 9", "set 5:tpdo2 --timer 9", "apply FILE")),
    "script-link": Job(
        _script("set 1:tpdo2 --timer 9", "link 1:tpdo1 5:rpdo1", "set 9:tpdo1 --timer 4", "unlink 1:tpdo1 5:rpdo1")
    ),
    "script-undo": Job(_script("set 1:tpdo2 --timer 9", "set 5:tpdo2 --timer 9", "undo", "set 9:tpdo2 --timer 9")),
    "script-store": Job(_script("set 1:tpdo1 --timer 40", "set 5:tpdo1 --timer 40", "node 5", "store")),
    "script-apply-store": Job(_script("set 1:tpdo2 --timer 9", "apply FILE", stores=True)),
    "undo": Job(
        lambda session, _chain: undo(session, everything=True), lambda session, chain: apply_file(session, _file(chain))
    ),
    "recover": Job(lambda session, _chain: recover(session), _cut, waits=True),
    "recover-stores": Job(lambda session, _chain: recover(session), _unstored, waits=True),
    "recover-finish": Job(lambda session, _chain: recover(session, finish=True), _unstored, waits=True),
    "recover-accept": Job(lambda session, _chain: recover(session, accept=True), _unstored, waits=True),
}


def _prepared(disk: Path, job: Job, number: int = 0) -> Chain:
    """Three nodes whose files are on *disk*, in folders of this *number*, after what comes before *job*."""
    for name in HOMES:
        os.environ[name] = str(disk / f"home{number}")
    (disk / f"home{number}").mkdir()
    chain = Chain(disk / f"home{number}" / "journals", families=dict(job.families))
    with chain.session(node=None) as session:
        job.before(session, chain)
    chain.wait(1.0)
    return chain


def _held(chain: Chain) -> tuple[Any, Any]:
    return chain.held(), chain.stored()


def _run(chain: Chain, job: Job) -> DvtcliError | None:
    try:
        with chain.session(node=None) as session:
            job.act(session, chain)
    except DvtcliError as failed:
        return failed
    return None


def _judge(disk: Path, job: Job, number: int, done: tuple[Any, Any]) -> None:
    """The disk is full from operation *number* on."""
    chain = _prepared(disk, job)
    before = _held(chain)
    with filled_at(disk, number) as names:
        failed = _run(chain, job)
    assert len(names) >= number
    assert _held(chain) == (done if failed is None else before), (failed and failed.text, names)
    if failed is not None:
        assert failed.exit_code in (1, 6), (failed.text, failed.why, failed.details)
        assert failed.state in ("unchanged", "rolled_back")
    waits = job.waits and failed is not None
    if not waits:
        assert chain.states() == OPERATIONAL
        assert chain.journals() == []
    empty(disk)
    if not waits:
        with chain.session(node=None) as session:
            assert not session.open_network().change_files.interrupted(5, None)  # type: ignore[union-attr]
            recover(session)
    assert _held(chain) == (done if failed is None else before)
    if failed is not None:
        assert _run(chain, job) is None
        assert _held(chain) == done
        assert chain.journals() == []


@pytest.mark.drawn(2)
@pytest.mark.parametrize("name", JOBS)
def test_all_is_as_before_or_all_is_done(tmp_path: Path, pytestconfig: pytest.Config, name: str) -> None:
    """Before as many of its file operations as `--kills` says."""
    disk, job = tmp_path / "disk", JOBS[name]

    def judge_all() -> None:
        chain = _prepared(disk, job)
        with filled_at(disk, 0) as names:
            assert _run(chain, job) is None
        done = _held(chain)
        for number in part(range(1, len(names) + 1), pytestconfig.getoption("--kills"), pytestconfig, name):
            if wrong := on_small_disk(disk, lambda number=number: _judge(disk, job, number, done)):  # type: ignore[misc]
                raise AssertionError(f"operation {number}, {names[number - 1]}: {wrong}")

    if wrong := on_small_disk(disk, judge_all):
        pytest.fail(wrong)


@pytest.mark.parametrize("full", ["journals", "locks"])
def test_the_hint_names_the_folder_that_is_on_another_disk(tmp_path: Path, full: str) -> None:
    """`--journal` moves the journals, and not the locks, at which every dvtcli looks."""
    disk = tmp_path / "disk"

    def refused() -> None:
        for name in HOMES:
            os.environ[name] = str(disk / "home" if full == "locks" else tmp_path / "home")
        kept = disk / "kept" if full == "journals" else tmp_path / "kept"
        chain = Chain(kept, families=FAMILIES)
        fill(disk)
        with chain.session(node=5) as session, pytest.raises(SafetyRefusal) as told:
            configure(session, session.node(5), {Pdo.parse("tpdo1"): PdoRequest(transmission_type=7)})
        assert disk in Path(str(told.value.place)).parents
        assert ("--journal DIR" in typed(told.value.hint)) is (full == "journals")
        assert ("XDG_STATE_HOME=DIR" in typed(told.value.hint)) is (full == "locks")
        if full == "journals":
            chain.folder = tmp_path / "another"
        else:
            os.environ["XDG_STATE_HOME"] = str(tmp_path / "another")
        with chain.session(node=5) as session:
            assert configure(session, session.node(5), {Pdo.parse("tpdo1"): PdoRequest(transmission_type=7)})

    if wrong := on_small_disk(disk, refused):
        pytest.fail(wrong)
