"""`lss bitrate`: all nodes on a bus run at another bit rate and are seen there, or all run at the old one again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.bus.python_can import BitRateSetter
from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.can_ids import LSS_REQUEST_ID
from dvtcli.domain.lss_services import BIT_TIMINGS
from dvtcli.domain.nmt import NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.errors import DeviceRefused, SafetyRefusal
from dvtcli.simulator.device.simulated_faults import Fault
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.cli.commands.bench import Bench, Ran
from tests.lss_nodes import address_of, unconfigured
from tests.virtual_time import ANSWER_S, VirtualTimeBus

pytestmark = pytest.mark.drawn(8, "lss bit rate")

OLD, NEW = 250_000, 500_000


def three() -> list[StrictDevice]:
    nodes = [unconfigured(1, node_id=3), unconfigured(2, node_id=5), unconfigured(3)]
    for one in nodes:
        one.set_value(0x6041, 0, (0x0250).to_bytes(2, "little"))  # switch on disabled: a reset lets nothing go
    return nodes


def bench(bus: VirtualTimeBus, **options: Any) -> Bench:
    return Bench((), {"yes": True, **options}, bus)


def bus_of(nodes: list[StrictDevice], *faults: str, bit_rate: int | None = OLD) -> VirtualTimeBus:
    return VirtualTimeBus(nodes, faults=[Fault.parse(one) for one in faults], simulated=False, bit_rate=bit_rate)


def rates(nodes: list[StrictDevice]) -> list[tuple[int | None, int | None]]:
    """What each runs at, and has stored."""
    return [(one.lss.bit_rate, one.lss.stored_rate) for one in nodes]


def ran(bus: VirtualTimeBus, line: str, **options: Any) -> Ran:
    with bench(bus, **options) as desk:
        return desk.run(line)


@pytest.mark.parametrize("known", [[], [OLD], [OLD, NEW]])
def test_store_keeps_no_bit_rate_that_was_told_and_never_activated(known: list[int]) -> None:
    """As a dvtcli leaves it that was killed before it activated one; who takes no bit rate was told none."""
    nodes = three()
    with bench(bus := bus_of(nodes)) as desk:
        nodes[0].lss.known_rates = known
        with LssMaster(bus) as master:
            master.select(address_of(nodes[0]))
            with suppress(DeviceRefused):
                master.configure_bit_rate(NEW)
        said = desk.run("lss store 3")
        assert said.code == 0, said.stderr
    assert rates(nodes)[0] == (OLD, OLD)


@pytest.mark.parametrize("bit_rate", [rate for rate in BIT_TIMINGS if rate != OLD])
def test_all_nodes_run_at_the_new_one(bit_rate: int) -> None:
    nodes = three()
    with bench(bus := bus_of(nodes)) as desk:
        told = desk.run(f"lss bitrate {bit_rate} --json").document
        assert (told["before"], told["bit_rate"]) == (OLD, bit_rate)
        assert [(one["node"], one["stored"]) for one in told["nodes"]] == [(3, False), (5, False), (None, False)]
        assert (rates(nodes), bus.bit_rate) == ([(bit_rate, OLD)] * 3, bit_rate)
        assert desk.run("read 5:1018:4 --json").document["value"] == 2
        assert desk.run("lss identify --json").document["without_node_id"] == 1
        assert "already" in desk.run(f"lss bitrate {bit_rate}").stdout


def test_it_is_stored_once_all_are_back() -> None:
    nodes = three()
    assert [one["stored"] for one in ran(bus_of(nodes), "lss bitrate 500k --store --json").document["nodes"]] == [
        True,
        True,
        True,
    ]
    assert rates(nodes) == [(NEW, NEW)] * 3


def test_nodes_are_silent_and_so_are_we_while_all_switch() -> None:
    """CiA 305: no frame from the activation until twice the switch delay is over."""
    nodes = three()
    nodes[0].set_value(0x1017, 0, (50).to_bytes(2, "little"))
    bus = bus_of(nodes)
    frames: list[tuple[float, Frame]] = []
    bus.tap(lambda frame, _ours: frames.append((bus.now_s(), frame)))
    assert ran(bus, "lss bitrate 500k").code == 0
    (began_s,) = [at_s for at_s, frame in frames if frame.can_id == LSS_REQUEST_ID and frame.data[0] == 0x15]
    assert not [frame for at_s, frame in frames if began_s + 0.001 < at_s < began_s + 2]
    assert bus.destroyed == 0


@pytest.mark.parametrize("kind", ["keeps-bit-rate", "no-bit-timing"])
@pytest.mark.parametrize("faulty", ["3", "5"])
def test_where_one_does_not_take_it_all_have_the_old_one(kind: str, faulty: str) -> None:
    nodes = three()
    bus = bus_of(nodes, f"{faulty}:{kind}")
    told = ran(bus, "lss bitrate 500k --store")
    assert (told.code, "bit/s as before" in told.stderr) == (5 if kind == "keeps-bit-rate" else 1, True), told.stderr
    assert (rates(nodes), bus.bit_rate) == ([(OLD, OLD)] * 3, OLD)
    assert ran(bus_of(nodes, bit_rate=OLD), "lss store 3").code == 0
    assert rates(nodes)[0] == (OLD, OLD)


def test_one_that_is_lost_is_said_and_a_power_on_brings_it_back() -> None:
    nodes = three()
    bus = bus_of(nodes, "5:loses-bit-rate")
    told = ran(bus, "lss bitrate 500k --store")
    told.failed(7, f"not all nodes could be returned to {OLD}")
    assert "node 5" in told.stderr
    assert "switch all nodes off and on" in told.stderr
    assert [rates(nodes)[0], rates(nodes)[2]] == [(OLD, OLD)] * 2
    nodes[1].restart()
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_where_one_cannot_store_nobody_has_the_new_one_stored() -> None:
    nodes = three()
    told = ran(bus_of(nodes, "5:store-fails"), "lss bitrate 500k --store")
    told.failed(1, "storage medium failed")
    assert "node 3 stored that again; no node has stored 500000" in told.stderr
    assert "node    5, vendor" in told.stderr
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_where_the_first_one_cannot_store_nobody_is_said_to_have_stored() -> None:
    told = ran(bus_of(nodes := three(), "3:store-fails"), "lss bitrate 500k --store")
    assert (told.code, "stored that again" in told.stderr) == (1, False)
    assert f"all nodes run at {OLD} bit/s as before; no node has stored 500000" in told.stderr
    assert "node    3, vendor" in told.stderr
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_what_the_bus_runs_at_already_can_be_stored() -> None:
    nodes = three()
    with bench(bus_of(nodes)) as desk:
        assert desk.run("lss bitrate 500k").code == 0
        assert "nothing was sent" in desk.run("lss bitrate 500k").stdout
        assert rates(nodes) == [(NEW, OLD)] * 3
        told = desk.run("lss bitrate 500k --store --json")
        assert [one["stored"] for one in told.document["nodes"]] == [True] * 3, told.stderr
    assert rates(nodes) == [(NEW, NEW)] * 3


@pytest.mark.parametrize(("faulty", "code", "stored"), [(3, 1, [OLD, OLD, OLD]), (5, 7, [NEW, OLD, OLD])])
def test_where_one_cannot_store_what_it_runs_at_it_is_said_who_has(faulty: int, code: int, stored: list[int]) -> None:
    nodes = three()
    bus = bus_of(nodes, f"{faulty}:store-fails")
    with bench(bus) as desk:
        assert desk.run("lss bitrate 500k").code == 0
        told = desk.run("lss bitrate 500k --store")
    told.failed(code, f"node    {faulty}, vendor")
    assert ("node 3 stored 500000 bit/s" in told.stderr) == (code == 7)
    assert rates(nodes) == [(NEW, one) for one in stored]


def test_a_store_is_proved_by_a_reset_of_all() -> None:
    nodes = three()
    told = ran(bus := bus_of(nodes), "lss bitrate 500k --store --prove --json")
    assert (told.code, [one["proved"] for one in told.document["nodes"]]) == (0, [True, True, False]), told.stderr
    assert (rates(nodes), bus.destroyed) == ([(NEW, NEW)] * 3, 0)
    assert "proved by a reset" in ran(bus_of(three()), "lss bitrate 500k --store --prove").stdout


def test_who_only_says_that_it_stored_is_found_out_and_all_go_back() -> None:
    nodes = three()
    told = ran(bus_of(nodes, "5:stores-nothing"), "lss bitrate 500k --store --prove")
    told.failed(1, "node 5 confirmed the store of 500000 bit/s")
    assert "no node has stored 500000" in told.stderr
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_where_nobody_knows_what_was_stored_before_it_is_left_and_said() -> None:
    nodes = three()
    with bench(bus_of(nodes, "5:stores-nothing")) as desk:
        assert desk.run("lss bitrate 500k").code == 0
        told = desk.run("lss bitrate 500k --store --prove")
    told.failed(7, "its stored bit rate before is unknown")
    assert rates(nodes) == [(NEW, NEW), (OLD, OLD), (NEW, NEW)]


def spoiled_at_reset(bus: VirtualTimeBus, spoil: Callable[[], None]) -> None:
    """Let *spoil* happen as all are told to reset."""
    bus.tap(lambda frame, ours: spoil() if ours and frame == Frame(0, b"\x81\0") else None)


def test_one_that_is_nowhere_after_its_reset_is_said() -> None:
    nodes = three()
    bus = bus_of(nodes)
    spoiled_at_reset(bus, lambda: setattr(nodes[1].lss, "stored_rate", 125_000))
    told = ran(bus, "lss bitrate 500k --store --prove")
    told.failed(7, "it does not answer at 250000 bit/s either")
    assert (rates(nodes)[0], rates(nodes)[2], bus.bit_rate) == ((NEW, NEW), (NEW, NEW), NEW)


class NoSignOfLife(VirtualTimeBus):
    """Heartbeat and boot-up of node 5 are not heard here."""

    def _to_us(self, frame: Frame, delay_s: float = ANSWER_S) -> None:
        if frame.can_id != 0x705:
            super()._to_us(frame, delay_s)


def test_a_reset_that_was_not_heard_proves_nothing() -> None:
    nodes = three()
    told = ran(NoSignOfLife(nodes, simulated=False, bit_rate=OLD), "lss bitrate 500k --store --prove")
    told.failed(1, "node 5: no boot-up message was received")
    assert rates(nodes) == [(NEW, NEW)] * 3


def test_no_drive_that_may_move_is_reset() -> None:
    nodes = three()
    nodes[1].set_value(0x6041, 0, (0x0027).to_bytes(2, "little"))
    bus = bus_of(nodes)
    told = ran(bus, "lss bitrate 500k --store --prove")
    told.failed(6, "node 5 has operation enabled")
    assert rates(nodes) == [(OLD, OLD)] * 3
    assert ran(bus_of(nodes), "lss bitrate 500k --store").code == 0


def test_error_frames_of_its_own_try_are_no_news() -> None:
    told = ran(bus_of(three(), "5:keeps-bit-rate"), "lss bitrate 500k")
    assert (told.code, "error frames" in told.stderr) == (5, False), told.stderr


def test_who_does_not_say_its_nmt_state_is_named() -> None:
    nodes = three()
    bus = bus_of(nodes)
    nodes[1].set_value(0x1017, 0, bytes(2))
    with bench(bus) as desk:
        bus.send_nmt(NmtCommand.ENTER_PRE_OPERATIONAL, 5)  # that it was heard to boot up says no more
        told = desk.run("lss bitrate 500k")
    assert "warning: node 5: no heartbeat shows whether it is OPERATIONAL" in told.stderr
    assert told.code == 0


@pytest.mark.long
@settings(max_examples=max(3, settings().max_examples // 6))
@given(st.integers(0, 2), st.integers(1, 60))
def test_a_node_whose_power_fails_leaves_no_bus_of_two_bit_rates(which: int, after: int) -> None:
    """It comes back at what it has stored, whenever it goes: then all run there, or it is said who does not."""
    nodes = three()
    bus = bus_of(nodes)
    requests = 0

    def fail(frame: Frame, ours: bool) -> None:
        nonlocal requests
        requests += ours and frame.can_id == LSS_REQUEST_ID
        if ours and requests == after and frame.can_id == LSS_REQUEST_ID:
            nodes[which].restart()
            nodes[which].boot_up()

    bus.tap(fail)
    told = ran(bus, "lss bitrate 500k")
    now = {one.lss.bit_rate for one in nodes}
    assert now == {bus.bit_rate} or told.code == 7, told.stderr
    assert now == {NEW} or told.code != 0, told.stderr
    assert {one.lss.stored_rate for one in nodes} == {OLD}
    if told.code == 7:
        assert "switch all nodes off and on" in told.stderr


def strange(bus: VirtualTimeBus, frame: Frame) -> None:
    """Let *frame* be said while we listen for other masters."""
    began = False

    def say(_frame: Frame, _ours: bool) -> None:
        nonlocal began
        if not began:
            began = True
            bus.nodes_said(frame)

    bus.tap(say)
    bus.nodes_said(frame)


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        (Frame(0x123, b"\1"), "0x123 was received"),
        (Frame(0x080, b""), "0x080 was received"),
        (Frame(0x701, b"\x7f"), "has no readable LSS address"),
        (Frame(0x605, b"\x40\0\x10\0\0\0\0\0"), "another master is active"),
    ],
)
def test_whoever_else_is_heard_stops_it(frame: Frame, said: str) -> None:
    nodes = three()
    bus = bus_of(nodes)
    strange(bus, frame)
    told = ran(bus, "lss bitrate 500k")
    told.failed(6, said)
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_a_machine_that_runs_is_left_alone() -> None:
    nodes = three()
    bus = bus_of(nodes)
    nodes[1].set_value(0x1017, 0, (100).to_bytes(2, "little"))
    nodes[1].nmt(1)
    told = ran(bus, "lss bitrate 500k")
    told.failed(6, "OPERATIONAL: node 5")
    assert rates(nodes) == [(OLD, OLD)] * 3


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["a: {node_id: 3}"], "node 5 on the bus, and not in"),
        (["a: {node_id: 3}", "b: {node_id: 5}", "c: {node_id: 7}"], "but in"),
        (["a: {node_id: 3}", "b: {node_id: 5}"], "nodes without a node-ID are on the bus"),
    ],
)
def test_a_file_names_all_who_may_be_there(tmp_path: Path, lines: list[str], said: str) -> None:
    nodes = three()
    file = tmp_path / "line.yaml"
    file.write_text("nodes:\n" + "".join(f"  {line}\n" for line in lines), "utf-8")
    told = ran(bus_of(nodes), f"lss bitrate 500k {file}")
    told.failed(6, said)
    assert rates(nodes) == [(OLD, OLD)] * 3
    del nodes[2]
    assert ran(bus_of(nodes), f"lss bitrate 500k {file}").code == (6 if len(lines) != 2 else 0)


@pytest.mark.parametrize("options", [{"yes": False}, {"dry_run": True}])
def test_nothing_is_changed_without_consent(options: dict[str, bool]) -> None:
    nodes = three()
    told = ran(bus_of(nodes), "lss bitrate 500k", **options)
    assert told.code == (0 if "dry_run" in options else 6)
    assert rates(nodes) == [(OLD, OLD)] * 3


def test_a_dry_run_reads_the_file_and_sends_nothing(tmp_path: Path) -> None:
    bus = bus_of(three())
    sent: list[Frame] = []
    bus.tap(lambda frame, ours: sent.append(frame) if ours else None)
    (tmp_path / "bad.yaml").write_text("nodes: 5\n", "utf-8")
    assert ran(bus, "lss bitrate 500k", dry_run=True).code == 0
    assert ran(bus, f"lss bitrate 500k {tmp_path}/bad.yaml", dry_run=True).code == 4
    assert sent == []


def test_a_node_that_takes_no_part_in_lss_stops_it() -> None:
    nodes = three()
    bus = bus_of(nodes)
    nodes[1].set_value(0x1018, 4, b"\0\0\0\0")
    nodes[1].lss.handle = lambda _request: None  # type: ignore[method-assign]
    told = ran(bus, "lss bitrate 500k")
    told.failed(6, "node 5 does not support LSS")
    assert rates(nodes) == [(OLD, OLD)] * 3


@pytest.mark.parametrize("dry_run", [False, True])
def test_a_bus_of_no_bit_rate_is_refused(dry_run: bool) -> None:
    nodes = three()
    told = ran(bus_of(nodes, bit_rate=None), "lss bitrate 500k", dry_run=dry_run)
    told.failed(6, "is unknown")


def test_a_simulated_bus_can_be_rehearsed_on() -> None:
    with Bench(("gen4", "tmcm@5"), {"yes": True, "bitrate": 125_000}) as desk:
        told = desk.run("lss bitrate 1M --json").document
        assert (told["before"], told["bit_rate"], len(told["nodes"])) == (125_000, 1_000_000, 2)
        assert desk.run("read 5:1000").code == 0


def test_a_simulated_node_at_another_bit_rate_is_not_heard_and_disturbs() -> None:
    with Bench(("gen4", "tmcm@5"), {"fault": ("5:bit-rate=125000",), "timeout": 0.05}, in_real_time=True) as desk:
        told = [desk.run("read 1:1000"), *(desk.run("read 5:1000") for _ in range(3))]
        assert [one.code for one in told] == [0, 5, 5, 5]
        assert desk.session.bus.error_frame_count() >= 5
        assert any("error frames" in one.stderr for one in told)
        assert desk.session.bus.nmt_state(5) is None
        assert desk.session.bus.nmt_state(1) is NmtState.PRE_OPERATIONAL


def test_a_can_link_of_linux_is_refused_with_the_lines_for_a_bus_whose_nodes_run_so() -> None:
    """Alone they would take us off the bus on which the nodes are."""
    setter = BitRateSetter({"interface": "socketcan", "channel": "can9"}, lambda _config: pytest.fail("opened"))
    with pytest.raises(SafetyRefusal) as caught:
        setter.require(NEW, listen_only=False)
    assert "together with the nodes nor restored" in str(caught.value.why)
    assert typed(caught.value.hint).startswith("where the nodes run at it already: sudo ip link set can9 down;")
