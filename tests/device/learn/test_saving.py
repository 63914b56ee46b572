"""`learn --with-store`: 0x1010 is read first, and told to save at most twice, what must be refused first."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from dvtcli.device.learn.saving import read_storage
from dvtcli.device.node import Node
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.request import PdoRequest
from dvtcli.errors import NoAnswer
from dvtcli.files.eds.reader import read_eds
from dvtcli.files.profiles import load_folder_profile
from dvtcli.operations.devices.learn_device import learn
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.family import Family
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family, load_family_folder
from tests.cli.commands.bench import Ran
from tests.device.learn.questions import Question, put
from tests.device.learn.test_consent import sent
from tests.device.learn.test_learnt_families import booted
from tests.device.learn.virtual import VirtualWire
from tests.device.test_reading_and_storing import Table
from tests.harness.sample import heavy
from tests.laws.bench import NODE, DirectBus
from tests.virtual_time import VirtualTimeBus

SAVE = int.from_bytes(b"save", "little")
EDS = family_eds("generic")
TPDO1 = Pdo.parse("tpdo1")


def made(**behaviour: object) -> StrictDevice:
    """A CiA 301 device that saves as *behaviour* says."""
    return StrictDevice(read_eds(EDS).dictionary, load_family("generic")._replace(**behaviour), 1)


def signatures(wire: VirtualWire) -> list[bytes]:
    """What was written to 0x1010:01 since the wire was last asked."""
    return [bytes(frame.data[4:]) for frame in sent(wire.frames()) if bytes(frame.data[1:4]) == b"\x10\x10\x01"]


@pytest.fixture(scope="module")
def ran() -> Iterator[tuple[Ran, list[bytes], StrictDevice]]:
    """`learn --with-store` on a device that saves on command, and what that wrote to 0x1010."""
    node = made()
    wire = VirtualWire(node)
    with wire.bench({"eds": str(EDS)}) as bench:
        yield bench.run("learn --with-store --yes --json"), signatures(wire), node


@heavy
def test_it_is_told_to_save_once_wrongly_and_once_rightly(ran: tuple[Ran, list[bytes], StrictDevice]) -> None:
    answered, written, _ = ran
    assert (answered.code, written, answered.document["saves"]) == (0, [bytes(4), b"save"], 2), answered
    said = {row["key"]: row["value"] for row in answered.document["family"]}
    assert said["wrong_signature"] == 0x08000020
    assert (said["save_answer"], said["store_capability"]) == (0, 1)
    assert {row["key"]: row["value"] for row in answered.document["profile"]}["store.sub_indices"] == [1]


def test_what_sub_indices_1_to_4_say_is_read() -> None:
    """CiA 301, 7.5.2.13: all parameters, those of communication, those of the application, the maker's own."""
    table = Table({(0x1010, sub): bytes([sub, 0, 0, 0]) for sub in range(6)} | {(0x1011, 2): b"\1\0\0\0"})
    storage = read_storage(Node(DirectBus(made(), table), NODE))
    assert (storage.save, storage.load) == ({1: 1, 2: 2, 3: 3, 4: 4}, {2: 1})


def test_what_is_saved_is_what_it_was_found_with(ran: tuple[Ran, list[bytes], StrictDevice]) -> None:
    _, _, node = ran
    kept, fresh = node.areas.kept(), made()
    assert kept
    assert {place: data for place, data in kept.items() if data != fresh.value(*place)} == {}


@heavy
def test_without_the_option_nothing_is_saved_and_what_it_says_is_learnt() -> None:
    wire = VirtualWire(made(store_capability=3, restore_capability=1))
    with wire.bench({"eds": str(EDS)}) as bench:
        ran = bench.run("learn --yes --json")
    assert (ran.code, signatures(wire), ran.document["saves"]) == (0, [], 0), ran
    said = {row["key"]: row["value"] for row in ran.document["family"]}
    assert (said["store_capability"], said["restore_capability"]) == (3, 1)
    assert "save_answer" not in said
    why = {row["name"]: row["why"] for row in ran.document["probes"]}
    assert why["save"] == why["wrong signature"] == "only if a store is allowed"


@heavy
@pytest.mark.parametrize(
    ("behaviour", "written"),
    [
        ({"wrong_signature": 0}, [bytes(4)]),
        ({"wrong_signature": 0x06090030}, [bytes(4), b"save"]),
        ({"save_answer": 0x08000022}, [bytes(4), b"save"]),
        ({"store_capability": 2}, []),
        ({"store_capability": 0}, []),
    ],
    ids=["takes anything", "another code", "refuses", "saves by itself", "does not save"],
)
def test_what_is_learnt_saves_the_same(behaviour: dict[str, int], written: list[bytes]) -> None:
    node = made(**behaviour)
    wire = VirtualWire(node)
    with wire.bench({"eds": str(EDS)}) as bench:
        ran = bench.run("learn --with-store --yes --save pump --json")
        assert (ran.code, signatures(wire)) == (0, written), ran
    learnt = load_family_folder(Path("pump"))
    for value in (0, SAVE)[: len(written)]:
        assert answers(node.family, value) == answers(learnt, value)
    taken = bool(written) and behaviour.get("wrong_signature", 1) != 0 and "save_answer" not in behaviour
    assert ("store.sub_indices" in {row["key"] for row in ran.document["profile"]}) is taken
    assert load_folder_profile(Path("pump")).store.sub_indices == (1,)


def answers(family: Family, value: int) -> list[str]:
    """What a device of *family* says when *value* is written to 0x1010:01, and what that reads after it."""
    return put(booted(EDS, family), Question("save", ((0x1010, 1, value, 4),)))


def test_what_was_not_stored_is_named_before_it_is() -> None:
    wire = VirtualWire(made())
    with wire.bench({"eds": str(EDS)}) as bench:
        assert bench.run("set tpdo1 --timer 77").code == 0
        asked = " ".join(bench.run("learn --with-store").stderr.split())
        assert "0x1010:01 is written twice" in asked
        assert "TPDO1" in asked.partition("0x1010:01")[2]
        assert not signatures(wire)


def test_how_a_device_that_saves_by_itself_is_asked_about() -> None:
    wire = VirtualWire(made(store_capability=2))
    with wire.bench({"eds": str(EDS)}) as bench:
        asked = " ".join(bench.run("learn --with-store").stderr.split())
        assert "0x1010:01 is 2: it stores on its own, so each write wears its memory" in asked
        assert "written up to" in asked


@heavy
@pytest.mark.parametrize("signature", [1, 2])
def test_a_device_that_restarts_at_a_signature_is_as_it_was_and_may_have_saved(signature: int) -> None:
    wire = VirtualWire(made())
    with wire.bench({"eds": str(EDS)}) as bench:
        bench.run("learn --yes --json")
        ahead = len(sent(wire.frames()))
    faults = (f"reset@{ahead + signature}=0.05",)
    wire = VirtualWire(made(), faults=faults)
    with wire.bench({"eds": str(EDS)}) as bench:
        node = bench.session.node(1)
        before = {pdo: node.pdo(pdo) for pdo in node.present()}
        ran = bench.run("learn --with-store --yes --json")
        assert (ran.code in (1, 5), ran.document["state"]) == (True, "unknown"), ran
        assert len(signatures(wire)) == signature
        assert {pdo: node.pdo(pdo) for pdo in node.present()} == before


@contextmanager
def opened(node: StrictDevice, *faults: str) -> Iterator[Session]:
    """A session with *node*, in virtual time; TPDO1 has a transmission type of its own that is not stored."""
    bus = VirtualTimeBus([node], faults=[Fault.parse(word) for word in faults])
    with TemporaryDirectory() as folder:
        options = Options(yes=True, journal=folder, node=1)
        with Session(options, open_bus=lambda _options: bus) as session:
            session.open_network().files.own_eds[1] = EDS
            session.open_network().files.own_profile[1] = "generic"
            session.node(1).configure({TPDO1: PdoRequest(transmission_type=1)})
            session.node(1).release_lock()
            yield session


@heavy
def test_where_no_answer_to_save_came_in_time_nobody_says_that_nothing_was_stored() -> None:
    node = made()
    with opened(node, "slow-store=25") as session, pytest.raises(NoAnswer) as raised:
        learn(session, with_store=True)
    assert raised.value.state == "unknown"
    assert "nothing was stored" not in (raised.value.state_text or "")
    assert node.value(0x1800, 2) == b"\x01"


@heavy
@pytest.mark.parametrize(("answer", "unstored"), [(0, ["TPDO1"]), (0x08000020, [])])
def test_only_save_stores_what_was_not_stored(answer: int, unstored: list[str]) -> None:
    with opened(made(wrong_signature=answer)) as session:
        assert list(session.node(1).unstored) == ["TPDO1"]
        learn(session, with_store=True)
        assert list(session.node(1).unstored) == unstored
