"""`store --prove` and `restore --prove`: what a reset showed, and what it did not."""

from __future__ import annotations

import io
import re
import threading
from pathlib import Path
from typing import Any

import pytest

from dvtcli.device.resets import await_power_cycle
from dvtcli.device.store.canary import Canary, choose_canary
from dvtcli.device.store.pending import CHANGE
from dvtcli.device.store.prove_restore import prove_restore
from dvtcli.device.store.prove_store import Restart
from dvtcli.device.store.store_parameters import StoreAnswer
from dvtcli.domain.objects import RESTORE_PARAMETERS
from dvtcli.domain.store import POWER
from dvtcli.errors import NoAnswer
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds
from tests.bus.devices import unknown
from tests.cli.commands.bench import Bench, Ran, beside
from tests.cli.commands.bus import Wire, device
from tests.harness.sample import heavy
from tests.virtual_time import VirtualTimeBus

MAP = "map tpdo1 6064 606C"
#: how the generic drive's first TPDO is delivered, and how `MAP` leaves it
DEFAULT, MAPPED = ["6041:00"], ["6064:00", "606C:00"]


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of our own: others test on buses of the same name."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def sim(*faults: str, family: str = "generic") -> Bench:
    return Bench((family,), {"fault": faults, "yes": True, "timeout": 0.2})


def mapping(bench: Bench, pdo: int = 0) -> list[str]:
    return [entry["object"] for entry in bench.run("pdo --all --json").document["pdos"][pdo]["mapping"]]


def timers(bench: Bench) -> list[int | None]:
    return [pdo["event_timer_ms"] for pdo in bench.run("pdo --all --json").document["pdos"]]


def proved(ran: Ran) -> dict[str, Any]:
    """The fields of the proof that the last line printed."""
    document = ran.answer
    assert document["schema"] == "dvtcli.store/1"
    return document


@pytest.mark.parametrize("family", ["generic", "gen4", "espac", "tmcm", "lely"])
def test_a_store_that_is_kept_is_proved_by_a_canary_that_is_not(family: str) -> None:
    with sim(family=family) as bench:
        before = bench.run("pdo --all --json").document["pdos"]
        if all(pdo["enabled"] for pdo in before):
            assert bench.run("disable tpdo2").code == 0
            before = bench.run("pdo --all --json").document["pdos"]
        ran = bench.run("store --prove --json")
        assert ran.code == 0, ran.stdout
        document = proved(ran)
        assert (document["proved"], document["stored"], document["by"]) == (True, True, "reset-node")
        assert (document["differences"], document["unproved"]) == ([], None)
        assert document["compared"] == len(before)
        assert re.match(r"0x1[48]0\d:0[235] \(", document["canary"])
        assert bench.run("pdo --all --json").document["pdos"] == before


def test_what_was_not_kept_is_named() -> None:
    with sim("stores-nothing") as bench:
        assert bench.run(MAP).code == 0
        ran = bench.run("store --prove")
        assert ran.code == 1
        assert "NOT STORED" in ran.stdout
        assert "TPDO1: 0x1A00 is 6041:00/16, expected 6064:00/32 606C:00/32" in ran.stdout
        assert "proved" not in ran.stdout
        assert mapping(bench) == DEFAULT


def test_the_question_before_a_proof_names_the_reset(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("a: {node_id: 1, dcf: gen4, tpdo: {1: {event_timer: 70}}, store: true}\n")
    with Bench(("gen4",)) as bench:
        for line in ("nmt start", "map tpdo1 6041", "set tpdo1 --timer 5"):
            assert bench.run(f"{line} --yes").code == 0
        for line, says in (
            ("store --prove", "take it to PRE-OPERATIONAL for this change, reset it, and back?"),
            ("restore --prove", "return to its defaults, and is reset now; restore?"),
            ("restore", "return to its defaults; restore?"),
            ("set tpdo1 --timer 6", "take it to PRE-OPERATIONAL for this change, and back?"),
            (f"apply {file} --prove", "and store on node 1, then reset it?"),
            (f"apply {file}", "and store on node 1?"),
        ):
            ran = bench.run(line)
            assert (ran.code, says in ran.stderr) == (6, True), ran


def test_what_was_not_kept_is_neither_proved_nor_stored_in_json() -> None:
    with sim("stores-nothing") as bench:
        bench.run("set tpdo1 --timer 70")
        ran = bench.run("store --prove --json")
        assert ran.code == 1
        document = proved(ran)
        assert (document["proved"], document["stored"]) == (False, False)
        assert document["differences"] == ["TPDO1: event timer is 0, expected 70"]


def test_json_says_null_where_no_proof_was_asked_for() -> None:
    with sim() as bench:
        document = proved(bench.run("store --json"))
        assert (document["proved"], document["by"], document["stored"]) == (None, None, True)


@pytest.mark.parametrize("fault", ["keeps-ram", "saves-itself"])
def test_ram_that_is_kept_proves_nothing(fault: str) -> None:
    with sim(fault) as bench:
        assert bench.run(MAP).code == 0
        before = timers(bench)
        ran = bench.run("store --prove")
        assert ran.code == 1
        assert "NOT PROVED: RAM is kept over a reset, or the device stored on its own." in ran.stdout
        assert "store --prove power" in ran.stderr
        assert timers(bench) == before, "the canary was rolled back"
        assert mapping(bench) == MAPPED
        document = proved(bench.run("store --prove --json"))
        assert (document["proved"], document["stored"], document["differences"]) == (False, True, [])
        assert document["unproved"] == "RAM is kept over a reset, or the device stored on its own"


def test_a_device_that_says_that_it_saves_by_itself_is_not_told_to_store_for_a_proof() -> None:
    node = device("generic")
    node.set_value(0x1010, 1, (3).to_bytes(4, "little"))
    node.areas.saves_itself = True
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        wire.frames()
        ran = bench.run("store --prove")
        downloads = [m for m in wire.frames() if m.arbitration_id == 0x601 and m.data[0] >> 5 == 1]
    assert ran.code == 1
    assert "0x1010:01 is 3: the device saves by itself, too" in ran.stderr
    assert "store --prove power` finds out" in ran.stderr
    assert downloads == []


def test_save_is_never_repeated() -> None:
    bus, saves = beside([device("generic")], "lose-response@3"), list[bytes]()
    bus.tap(lambda frame, sent: saves.append(frame.data) if sent and frame.data[4:] == b"save" else None)
    with Bench((), {"node": 1, "yes": True}, bus) as bench:
        assert bench.run("store --prove").code == 5
    assert len(saves) == 1


def test_a_dry_run_stores_and_proves_nothing() -> None:
    with sim() as bench:
        for line in ("store --json --dry-run", "store --prove --json --dry-run"):
            ran = bench.run(line)
            document = proved(ran)
            assert ran.code == 0
            assert (document["stored"], document["proved"], document["dry_run"]) == (False, None, True)


def test_a_group_that_has_no_pdos_is_not_proved_by_them() -> None:
    with sim() as bench:
        ran = bench.run("store --prove application --json")
        assert (ran.code, ran.document["state"]) == (1, "unchanged")
        assert "group 3" in ran.document["why"]
        assert bench.run("store --prove communication --json").document["proved"] is True


@pytest.mark.parametrize(
    "line",
    [
        "store power",
        "store power --prove",
        "store --prove nothing",
        "store --prove all communication",
        "store --within 5",
        "store --prove --within 5",
        "store --prove --if-changed",
    ],
)
def test_what_is_no_way_to_prove_is_a_usage_error(line: str) -> None:
    with sim() as bench:
        assert bench.run(line).code == 2


# --- a canary on a real bus


def journals(folder: Path) -> list[Path]:
    return list((folder / "journals").glob("*"))


def on_bus(wire: Wire, folder: Path) -> Bench:
    return Bench((), {**wire.options, "yes": True, "journal": str(folder), "eds": generic()})


def generic() -> str:
    return str(family_eds("generic"))


def test_the_canary_is_journalled_and_put_back(tmp_path: Path) -> None:
    with Wire(device("generic"), faults=("keeps-ram",)) as wire, on_bus(wire, tmp_path) as bench:
        before = timers(bench)
        ran = bench.run("store --prove")
        assert ran.code == 1
        assert "NOT PROVED" in ran.stdout
        assert timers(bench) == before
        assert journals(tmp_path) == []
        assert bench.run("undo").code == 2, "it is no change of the user's"


@heavy
def test_a_canary_that_cannot_be_put_back_is_said_and_recover_finishes_it(tmp_path: Path) -> None:
    node = device("generic")
    # downloads: 1 and 2 try the canary, 3 the save, 4 the canary, 5 what puts it back; it is repeated for PATIENCE_S
    faults = ("keeps-ram", *(f"refuse@{number}=0x08000020" for number in range(5, 62)))
    options = {"yes": True, "timeout": 0.2, "journal": str(tmp_path), "eds": generic(), "node": 1}
    with Bench((), options, beside([node], *faults)) as bench:
        before = timers(bench)
        ran = bench.run("store --prove")
        assert ran.code == 7
        assert "acknowledged it before; it is not proved" in ran.stderr
        assert len(journals(tmp_path)) == 1
        assert timers(bench) != before
        assert bench.run("store").code == 6, "nothing is stored while it is there"
        codes = (bench.run("recover").code for _ in range(60))  # each takes at least one of the refusals that are left
        assert any(code in (0, 2) for code in codes)
        assert 0 in codes
        assert timers(bench) == before
        assert journals(tmp_path) == []


def test_the_canary_is_never_without_its_journal(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, on_bus(wire, tmp_path) as bench:
        node = bench.session.node()

        def held() -> list[int | None]:
            """The timers, read without a line: the end of one lets go of the node's lock."""
            node.forget()
            return [config.communication.event_timer for config in node.pdos().values()]

        before = held()
        place = choose_canary(node, node.pdos())
        assert place is not None
        assert (held(), journals(tmp_path)) == (before, [])
        canary = Canary(node, place)
        assert canary.write()
        assert held() != before
        assert len(journals(tmp_path)) == 1
        canary.roll_back()
        assert held() == before
        assert journals(tmp_path) == []


def test_nothing_is_asked_of_the_node_between_the_canary_and_its_restart_that_could_fail_without_a_journal(
    tmp_path: Path,
) -> None:
    with Wire(device("generic")) as wire, on_bus(wire, tmp_path) as bench:
        wire.frames()
        assert bench.run("store --prove").code == 0
        frames = wire.frames()
    sent = [bytes(frame.data) for frame in frames if frame.arbitration_id in (0x000, 0x601)]
    (saved,) = (number for number, data in enumerate(sent) if data[4:] == b"save")
    (reset,) = (number for number, data in enumerate(sent) if data == b"\x81\x01")
    written = [number for number in range(saved + 1, reset) if sent[number][0] >> 5 == 1]
    identity = [number for number in range(written[-1], reset) if sent[number][1:3] == b"\x18\x10"]
    assert len(written) == 1
    assert identity == [], "the journal that was begun before the write is the one that stays"


@heavy
def test_a_node_that_does_not_come_back_leaves_the_journal(tmp_path: Path) -> None:
    """A master ignores NMT: no boot-up comes, and what was changed is put back."""
    node = device("generic")
    with Wire(node) as wire, on_bus(wire, tmp_path) as bench:
        before = timers(bench)
        ran = bench.run("store --prove power --within 1")
        assert ran.code == 5
        assert "no boot-up message within 1 s" in ran.stderr
        assert "rolled back, read back equal" in ran.stderr
        assert timers(bench) == before
        assert journals(tmp_path) == []


@heavy
def test_a_proof_that_fails_does_not_say_that_nothing_was_written(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, on_bus(wire, tmp_path) as bench:
        ran = bench.run("store --prove power --within 1")
        assert ran.code == 5
        assert "0x1010:01 acknowledged the store, which is not proved" in ran.stderr
        assert "nothing was written" not in ran.stderr
        ran = bench.run("store --prove power --within 1 --json")
        assert (ran.code, ran.documents[-1]["state"]) == (5, "unknown")


def test_a_canary_that_kills_the_node_does_not_say_that_nothing_was_stored() -> None:
    with sim("silent@4") as bench:
        ran = bench.run("store --prove")
    assert ran.code in (5, 7), ran.stderr
    assert "0x1010:01 acknowledged the store, which is not proved" in ran.stderr
    assert "nothing was" not in ran.stderr


def test_a_proof_of_a_restore_that_fails_says_that_it_was_acknowledged(tmp_path: Path) -> None:
    with Wire(device("generic")) as wire, on_bus(wire, tmp_path) as bench:
        node = bench.session.node()
        restart = Restart(POWER, lambda: await_power_cycle(node.access, 0.1, lambda: None))
        with pytest.raises(NoAnswer) as caught:
            prove_restore(node, StoreAnswer(RESTORE_PARAMETERS, 1, 0.0), restart, None)
    assert caught.value.state == "unknown"
    assert "0x1011:01 acknowledged the restore, which is not proved" in (caught.value.state_text or "")


# --- a power cycle


class Hand:
    """Somebody who switches *node* off and on as soon as the screen asks for that."""

    def __init__(self, wire: Wire, node: StrictDevice, bench: Bench) -> None:
        self._wire, self._node, self._bench = wire, node, bench
        self._given_up = threading.Event()
        self._thread = threading.Thread(target=self._switch)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._given_up.set()
        self._thread.join()

    def _switch(self) -> None:
        while not self._given_up.wait(0.01):
            screen = self._bench.session.output.stderr
            if isinstance(screen, io.StringIO) and "switch node 1 off and on" in screen.getvalue():
                self._wire.power_cycle(self._node)
                return


@heavy
def test_a_power_cycle_proves_what_a_reset_cannot(tmp_path: Path) -> None:
    node = device("generic")
    with Wire(node, faults=("keeps-ram",)) as wire, on_bus(wire, tmp_path) as bench:
        assert bench.run(MAP).code == 0
        with Hand(wire, node, bench):
            ran = bench.run("store --prove power --json")
        assert ran.code == 0, ran.stdout + ran.stderr
        document = proved(ran)
        assert (document["proved"], document["by"]) == (True, "power-cycle")
        assert document["canary"] is not None
        assert mapping(bench) == MAPPED
        assert journals(tmp_path) == []


def test_a_power_cycle_shows_a_store_that_was_none(tmp_path: Path) -> None:
    node = device("generic")
    with Wire(node, faults=("keeps-ram", "stores-nothing")) as wire, on_bus(wire, tmp_path) as bench:
        assert bench.run(MAP).code == 0
        with Hand(wire, node, bench):
            ran = bench.run("store --prove power")
        assert ran.code == 1
        assert "NOT STORED: after the power cycle" in ran.stdout


def test_a_power_cycle_needs_somebody_or_yes() -> None:
    with Bench(("generic",)) as bench:
        ran = bench.run("store --prove power")
        assert ran.code == 6
        assert "--yes" in ran.stderr


# --- restore


def test_defaults_are_proved_by_those_of_the_eds() -> None:
    with sim() as bench:
        bench.script(MAP, "store")
        ran = bench.run("restore --prove --json")
        assert ran.code == 0
        document = proved(ran)
        assert (document["proved"], document["stored"]) == (True, False)
        assert document["against"] == "the defaults of generic.eds"
        assert mapping(bench) == DEFAULT


def test_a_restore_that_did_nothing_is_no_proof() -> None:
    with sim("restores-nothing") as bench:
        bench.script(MAP, "store")
        ran = bench.run("restore --prove")
        assert ran.code == 1
        assert "NOT RESTORED" in ran.stdout
        assert "TPDO1: 0x1A00:01 is 0x60640020, its default is 0x60410010" in ran.stdout
        assert proved(bench.run("restore --prove --json"))["proved"] is False


@pytest.mark.parametrize("family", ["generic", "gen4", "tmcm"])
def test_an_object_that_this_session_wrote_is_compared_with_its_default(family: str) -> None:
    with sim("restores-nothing", family=family) as bench:
        for line in ("write 1017 1000", "store"):
            assert bench.run(line).code == 0
        ran = bench.run("restore --prove")
        assert ran.code == 1, ran.stdout
        assert "NOT RESTORED" in ran.stdout
        assert "1017:00: is 1000 ms, its default is 500 ms" in ran.stdout
        assert bench.run("restore --prove").code == 1, "neither does it a second time"


@pytest.mark.parametrize("group", ["", "communication"])
def test_an_object_that_this_session_wrote_is_proved_to_hold_its_default(group: str) -> None:
    with sim() as bench:
        for line in ("write 1017 1000", "store"):
            assert bench.run(line).code == 0
        document = proved(bench.run(f"restore {group} --prove --json"))
        assert (document["proved"], document["objects"], document["compared"]) == (True, 1, 8)


def test_an_object_of_another_group_is_not_compared() -> None:
    with sim() as bench:
        for line in ("write 6083 1234", "store"):
            assert bench.run(line).code == 0
        assert proved(bench.run("restore communication --prove --json"))["objects"] == 0


def test_an_object_that_keeps_its_value_is_named_though_its_group_has_no_pdos() -> None:
    with sim("restores-nothing") as bench:
        for line in ("write 6083 1234", "store"):
            assert bench.run(line).code == 0
        document = proved(bench.run("restore application --prove --json"))
        assert [text.partition(" ")[0] for text in document["differences"]] == ["6083:00:"]


@pytest.mark.parametrize(
    ("lines", "said"), [([], True), ([MAP], True), (["write 1017 1000"], True), ([MAP, "store"], False)]
)
def test_defaults_that_were_there_anyway_are_not_said_to_come_from_the_load(lines: list[str], said: bool) -> None:
    """A change in RAM goes with the reset, whatever "load" does."""
    with sim() as bench:
        for line in lines:
            assert bench.run(line).code == 0
        ran = bench.run("restore --prove")
        assert ran.code == 0
        assert ("not that the load did it" in ran.stdout) is said


def test_what_verify_found_does_not_hold_a_restore_back() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True, "eds": generic()}) as bench:
        assert bench.run("set tpdo1 --timer 70").code == 0
        with wire.lock:
            node.set_value(0x1800, 5, b"\x47\0")
        assert bench.run("verify").code == 3
        assert bench.run("store").code == 6
        ran = bench.run("restore --prove")
        assert ran.code == 0, ran.stderr
        assert bench.run("store").code == 0


def test_a_change_that_could_not_be_put_back_holds_a_restore_back_in_its_own_words() -> None:
    with sim() as bench:
        bench.session.node().pending.suspicions[CHANGE] = "TPDO1 could not be rolled back"
        ran = bench.run("restore")
        assert ran.code == 6
        assert "node 1 is not restored: TPDO1 could not be rolled back" in ran.stderr
        assert "then `dvtcli --sim generic restore`" in ran.stderr
        assert "store;" not in ran.stderr


def test_without_an_eds_only_a_difference_is_proof() -> None:
    node = unknown(1)
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.session.node().dictionary is None
        assert bench.run(MAP).code == 0
        assert bench.run("store").code == 0
        ran = bench.run("restore --prove --json")
        assert ran.code == 0, ran.stdout
        assert (proved(ran)["proved"], proved(ran)["compared"]) == (True, 1)
        again = bench.run("restore --prove --json")
        assert again.code == 1
        assert proved(again)["proved"] is False
        assert "no EDS" in proved(again)["unproved"]


def test_without_an_eds_a_change_in_ram_is_no_difference() -> None:
    """What the reset takes anyway proves nothing about "load"."""
    ignoring = Wire(unknown(1), faults=("restores-nothing",))
    with ignoring as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run(MAP).code == 0
        ran = bench.run("restore --prove --json")
    assert ran.code == 1
    assert proved(ran)["proved"] is False


# --- only if changed


def test_a_node_that_holds_what_it_came_up_with_is_not_stored() -> None:
    with Wire(device("generic")) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        bench.run("pdo")
        assert proved(bench.run("store --if-changed --json"))["stored"] is True, "no boot-up message was received"
        wire.frames()
        ran = bench.script("nmt reset-node", "store --if-changed --json")
        sent = [m for m in wire.frames() if m.arbitration_id == 0x601 and m.data[4:] == b"save"]
    assert ran.code == 0
    document = proved(Ran(ran.code, ran.stdout.splitlines()[-1] + "\n", ""))
    assert (document["stored"], document["skipped"]) == (False, True)
    assert sent == []


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (["set tpdo1 --timer 70"], "it was written since its last boot-up"),
        (["set tpdo1 --timer 70", "undo"], "it was written since its last boot-up"),
        (["write 1006 0", "write 1006 1000"], "it was written since its last boot-up"),
        ([], "its PDOs were not read after its last boot-up"),
    ],
)
def test_else_it_is_stored(lines: list[str], reason: str) -> None:
    with sim() as bench:
        if lines:
            bench.run("pdo")
        for line in lines:
            assert bench.run(line).code == 0
        document = proved(bench.run("store --if-changed --json"))
        assert (document["stored"], document["skipped"], document["reason"]) == (True, False, reason)


def test_another_writer_is_seen() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.script("nmt reset-node").code == 0
        with wire.lock:
            node.set_value(0x1800, 5, b"\x46\0")
        document = proved(bench.run("store --if-changed --json"))
        assert (document["stored"], document["reason"]) == (True, "its PDOs differ from their values at boot")


def test_another_writer_before_the_first_read_is_seen() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.run("read 1000").code == 0
        bus = bench.session.node().bus
        boot_ups = bus.boot_ups(1)
        wire.power_cycle(node)
        assert bus.wait_boot_up(1, boot_ups, 5.0)
        with Bench((), {**wire.options, "yes": True}) as other:
            assert other.run("write 1800:5 70").code == 0
        assert bench.run("pdo").code == 0
        document = proved(bench.run("store --if-changed --json"))
        assert (document["stored"], document["skipped"]) == (True, False)
        assert document["reason"] == "another SDO client wrote to it since its last boot-up"
        wire.power_cycle(node)
        assert bus.wait_boot_up(1, boot_ups + 1, 5.0)
        assert timers(bench)[0] == 70


def test_another_reader_changes_nothing() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.script("nmt reset-node").code == 0
        with Bench((), {**wire.options, "yes": True}) as other:
            assert other.run("read 1000").code == 0
        assert proved(bench.run("store --if-changed --json"))["skipped"] is True


@heavy
def test_a_store_that_may_be_skipped_keeps_another_dvtcli_away_all_the_same() -> None:
    node = device("generic")
    with Wire(node) as wire, Bench((), {**wire.options, "yes": True}) as bench:
        assert bench.script("nmt reset-node").code == 0
        with Bench((), {**wire.options, "yes": True}) as other:
            other.session.node().begin_change()
            assert bench.run("store --if-changed").code == 6


@pytest.mark.parametrize("faults", [(), ("stores-nothing",)])
def test_what_was_not_stored_now_is_not_called_proved(faults: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    file.write_text("drive: {node_id: 5, store: true, tpdo: {1: {event_timer: 80}}}\n", "utf-8")
    with Bench(("generic@5",), {"fault": faults, "yes": True}) as bench:
        first = bench.run(f"apply {file}")
        assert (first.code, "store --prove` proves it" in first.stdout) == (0, True)
        again = bench.run(f"apply {file} --prove")
        assert (again.code, "nothing was written" in again.stdout) == (0, True)
        assert "node 5 stored nothing now, so the stored values are not proved; `dvtcli " in again.stderr
        assert bench.run("store --prove").code == (1 if faults else 0)


@pytest.mark.parametrize("is_dry", [False, True])
@pytest.mark.parametrize("file", ["net.yaml", "one.dcf"])
def test_a_proof_of_a_file_that_stores_nothing_is_said_to_be_none(file: str, is_dry: bool, tmp_path: Path) -> None:
    """Also quietly, and if nothing is to be written: a pipeline would take exit code 0 for the proof."""
    path = tmp_path / file
    with Bench(("generic@5",), {"yes": True, "quiet": True}) as bench:
        if file.endswith(".yaml"):
            path.write_text("drive: {node_id: 5, tpdo: {1: {event_timer: 80}}}\n", "utf-8")
        else:
            assert bench.run(f"export {path}").code == 0
        for _ in range(2):
            ran = bench.run(f"apply {path} --prove{' --dry-run' * is_dry}")
            assert ran.code == 0
            assert "warning: nothing is proved: " in ran.stderr
            assert "store --prove` stores and proves" in ran.stderr
        assert "nothing is proved" not in bench.run(f"apply {path}").stderr


def test_a_node_that_the_file_does_not_store_is_named_by_the_proof_of_the_others(tmp_path: Path) -> None:
    file = tmp_path / "net.yaml"
    timer = "tpdo: {1: {event_timer: 80}}"
    nodes = [f"a: {{node_id: 4, {timer}}}", f"b: {{node_id: 5, store: true, {timer}}}", "c: {node_id: 6}"]
    file.write_text("".join(f"{node}\n" for node in nodes), "utf-8")
    with Bench(("generic@4", "generic@5", "generic@6"), {"yes": True}) as bench:
        ran = bench.run(f"apply {file} --prove")
        assert (ran.code, "proved" in ran.stdout) == (0, True)
        assert "note: node 4: no `store: true`, so nothing is proved; `dvtcli " in ran.stderr
        assert " -n 4 store --prove` stores and proves" in ran.stderr


@pytest.mark.parametrize("others", [(), ("generic@5",)])
@pytest.mark.parametrize("stored", [False, True])
def test_no_proof_is_offered_for_a_node_that_cannot_store(
    others: tuple[str, ...], stored: bool, tmp_path: Path
) -> None:
    """The way that its maker has is said, and runs as printed also without an EDS."""
    file = tmp_path / "net.yaml"
    timer = "tpdo: {1: {event_timer: 80}}"
    nodes = [f"a: {{node_id: 4, {timer}}}\n", *(f"b: {{node_id: 5, {timer}}}\n" for _ in others)]
    nodes += [f"c: {{node_id: 6, store: true, {timer}}}\n"] * stored
    file.write_text("".join(nodes), "utf-8")
    with Bench(("roboteq@4", *others, "generic@6"), {"yes": True}) as bench:
        ran = bench.run(f"apply {file} --prove")
        said = " ".join(ran.stderr.split())
        assert ran.code == 0
        assert "node 4 cannot store (0x1010)" in said
        assert "; ;" not in said
        assert (" -n 4 store" in said, "-n 4,5 store" in said) == (False, False)
        assert said.count("store --prove` stores and proves") == len(others)
        assert "to keep it, `write 2017 1 --as u8`" in " ".join(ran.stdout.split())


def test_the_makers_way_to_store_runs_without_an_eds() -> None:
    with Bench((), {"node": 5, "yes": True}, bus=VirtualTimeBus([unknown(5, "roboteq")], simulated=False)) as bench:
        hint = re.search("`(write .*?)`", bench.run("store").stderr)
        assert hint is not None
        assert bench.run(hint[1]).code == 0


@heavy
@pytest.mark.parametrize("altered", ["1801:5:0x0063", "1401:2:0x05"])
def test_what_the_device_alters_with_the_canary_is_found_before_the_store_and_put_back(altered: str) -> None:
    """With the change that tries the reset, and with its way back."""
    for at in (1, 2):
        with sim(f"alters@{at}={altered}") as bench:
            before = bench.run("pdo --all --json").document["pdos"]
            ran = bench.run("store --prove")
            assert ran.code == 1, ran
            assert "when" in ran.stderr
            assert "to test the reset: nothing was stored" in ran.stderr
            assert bench.run("pdo --all --json").document["pdos"] == before
            assert bench.run("nmt reset-node").code == 0
            assert bench.run("pdo --all --json").document["pdos"] == before
