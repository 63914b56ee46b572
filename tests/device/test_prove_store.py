"""What a restart proves of a store or a restore: nothing by itself, and what was changed to find out is gone again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.node import Node
from dvtcli.device.store.canary import choose_canary
from dvtcli.device.store.prove_restore import prove_restore, restart_and_read
from dvtcli.device.store.prove_store import Restart, Snapshot, prepare_proof, prove_store
from dvtcli.device.store.store_parameters import StoreAnswer
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import GENERIC, StorePolicy
from dvtcli.domain.store import POWER, RESET_NODE, Proof
from dvtcli.errors import DeviceRefused, NoAnswer
from tests.harness.sample import heavy
from tests.laws.bench import NODE, DirectBus, booted, dictionary, profile

TPDO1 = Pdo.parse("tpdo1")
HEARTBEAT = (0x1017, 0)
STORED = StoreAnswer(STORE_PARAMETERS, 1, 0.0, 1)


class Bench:
    """A node whose TPDO1 is off, and ways to restart it."""

    def __init__(self, family: str = "generic") -> None:
        self.bus = DirectBus.of(booted(family))
        self.node = Node(self.bus, NODE, dictionary(family), profile(family))
        word = int.from_bytes(self.node.sdo.upload(0x1800, 1), "little") | 1 << 31
        self.node.sdo.download(0x1800, 1, word.to_bytes(4, "little"))

    def store(self) -> None:
        self.node.sdo.download(STORE_PARAMETERS, 1, b"save")

    def reset(self) -> None:
        self.bus.send_nmt(NmtCommand.RESET_NODE, NODE)

    def keep_ram(self) -> None:
        """A boot-up, after which everything is as it was, and the device has started itself."""
        self.bus.heard_boot_ups += 1
        self.bus.device.nmt(NmtCommand.START)

    def prove(self, before: Snapshot, restart: Restart) -> Proof:
        """Store nothing more, restart, and compare with *before*."""
        place = choose_canary(self.node, before.pdos)
        return prove_store(self.node, before, STORED, restart, place)

    def restart(self, run: Callable[[], None], *, certain: bool = False) -> Restart:
        return Restart(POWER if certain else RESET_NODE, run)


def test_a_store_that_stored_is_proved_by_what_the_restart_took() -> None:
    bench = Bench()
    bench.node.wanted_values[HEARTBEAT] = bench.node.sdo.upload(*HEARTBEAT)
    bench.node.profile = replace(GENERIC, store=StorePolicy(covers=(0x1000, 0xFFFF)))
    before = Snapshot.now(bench.node)
    bench.store()
    bench.bus.device.nmt(NmtCommand.START)
    proof = bench.prove(before, bench.restart(bench.reset))
    assert (proof.holds, proof.objects, proof.compared) == (True, 1, len(before.pdos))
    assert proof.canary.startswith("0x1800:05 (event timer of TPDO1)")
    assert bench.bus.device.state is NmtState.OPERATIONAL, "as it was found"
    assert bench.node.pdos() == before.pdos


def test_a_store_that_stored_nothing_is_told_by_what_is_not_there() -> None:
    bench = Bench()
    before = Snapshot.now(bench.node)
    proof = bench.prove(before, bench.restart(bench.reset))
    assert proof.differences
    assert not proof.holds
    assert all(text.startswith("TPDO1: COB-ID") for text in proof.differences)


@pytest.mark.parametrize("family", ["generic", "gen4"])
@pytest.mark.parametrize("certain", [False, True])
def test_a_canary_that_survived_is_put_back_and_nothing_is_proved(family: str, certain: bool) -> None:
    bench = Bench(family)
    before = Snapshot.now(bench.node)
    bench.store()
    proof = bench.prove(before, bench.restart(bench.keep_ram, certain=certain))
    assert (proof.differences, bool(proof.unproved)) == ((), True)
    assert ("not a power cycle" in proof.unproved) is certain
    assert proof.put_back.endswith("read back equal")
    assert bench.node.pdos() == before.pdos
    led_back = [NmtCommand.ENTER_PRE_OPERATIONAL] if family == "gen4" else []
    assert bench.bus.commands == led_back, "a family that takes no write while it runs is led back before the next one"


def test_after_a_restart_it_is_led_back_to_where_it_may_be_written() -> None:
    bench = Bench("gen4")
    bench.node.gate.enter()
    held, lost = restart_and_read(bench.node, bench.restart(bench.keep_ram))
    assert bench.bus.device.state is NmtState.PRE_OPERATIONAL
    assert (held.pdos, lost) == (bench.node.pdos(), ())


@heavy
def test_nor_does_a_device_that_starts_itself_end_the_gate() -> None:
    bench = Bench("gen4")
    before = Snapshot.now(bench.node)
    bench.store()
    bench.node.gate.enter()

    def start_itself() -> None:
        bench.reset()
        bench.bus.device.nmt(NmtCommand.START)

    assert bench.prove(before, bench.restart(start_itself)).holds
    assert bench.bus.device.state is NmtState.PRE_OPERATIONAL


def test_what_goes_wrong_says_first_that_the_store_was_acknowledged() -> None:
    bench = Bench()
    before = Snapshot.now(bench.node)
    bench.store()

    def silent() -> None:
        raise NoAnswer("no boot-up", state="unknown")

    with pytest.raises(NoAnswer) as caught:
        bench.prove(before, bench.restart(silent))
    (first, said), (second, _) = caught.value.details
    assert (first, said) == ("store", "0x1010:01 acknowledged it before; it is not proved")
    assert second == "changed"
    assert caught.value.state_text.startswith("unknown: 0x1010:01 acknowledged the store, which is not proved")
    assert bench.node.pdos() == before.pdos


def test_a_pdo_that_is_gone_after_the_restart_is_no_proof() -> None:
    bench = Bench()
    held = Snapshot.now(bench.node)
    before = replace(held, pdos={**held.pdos, Pdo.parse("tpdo400"): held.pdos[TPDO1]})
    bench.store()
    proof = bench.prove(before, bench.restart(bench.reset))
    assert (proof.holds, proof.differences) == (False, ("TPDO400 is gone",))


def test_what_cannot_be_proved_is_refused_ahead_of_the_store() -> None:
    """Where the device keeps all of it by itself, nothing is in RAM only."""
    bench = Bench()
    bench.node.profile = replace(GENERIC, store=StorePolicy(covers=(0x2000, 0xFFFF)))
    held, restart = Snapshot.now(bench.node), bench.restart(bench.reset)
    with pytest.raises(DeviceRefused) as caught:
        prepare_proof(bench.node, held, 1, restart)
    assert "has nothing that can be changed harmlessly" in (caught.value.why or "")
    assert "store --prove power" in typed(caught.value.hint)
    assert prepare_proof(bench.node, held, 1, restart._replace(by=POWER)) is None


@pytest.mark.parametrize("family", ["generic", "gen4"])
@pytest.mark.parametrize("off", [True, False])
def test_the_gate_is_asked_for_ahead_of_the_store_where_the_proof_needs_it(off: bool, family: str) -> None:
    """A heartbeat is changed in any state; a family that takes no write while it runs is led back first."""
    bench = Bench(family)
    if not off:
        bench.reset()
    bench.bus.device.nmt(NmtCommand.START)
    held = Snapshot.now(bench.node)
    held = held if off else replace(held, pdos={pdo: one for pdo, one in held.pdos.items() if one.enabled})
    assert prepare_proof(bench.node, held, 1, bench.restart(bench.reset)) is not None
    state = NmtState.PRE_OPERATIONAL if family == "gen4" else NmtState.OPERATIONAL
    assert bench.bus.device.state is state


@pytest.mark.parametrize(
    ("group", "hint"),
    [(1, "--eds FILE tells its defaults"), (3, "`restore all --prove` takes and compares them")],
)
def test_a_restore_without_a_file_says_what_would_prove_it(group: int, hint: str) -> None:
    bench = Bench()
    bench.node.dictionary = None
    before = Snapshot.now(bench.node)
    proof = prove_restore(
        bench.node, StoreAnswer(RESTORE_PARAMETERS, group, 0.0), bench.restart(bench.keep_ram), before
    )
    assert (proof.holds, typed(proof.hint)) == (False, hint)
