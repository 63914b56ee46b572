"""LSS where answers are lost, doubled, late or wrong: what is found is there, what was given is so, or it is said."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.can_ids import LSS_REQUEST_ID
from dvtcli.domain.lss_services import BITS, FAST_SCAN, IDENTIFIED, PARTS, LssAddress
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.ports import Frame
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer
from dvtcli.operations.lss.lss_find import scanned
from dvtcli.operations.lss.lss_node_id import lss_node_id
from dvtcli.operations.session.session import Session
from dvtcli.operations.user.options import Options
from dvtcli.simulator.device.strict_device import StrictDevice
from tests.lss_nodes import Fate, LossyBus, address_of, unconfigured
from tests.virtual_time import VirtualTimeBus

#: questions of one fast scan: whether somebody is there, and each part's bits, and the part as a whole
NEEDED = 1 + PARTS * (BITS + 1)
#: what may become of an answer: how much later it comes, or that something else does
FATES = st.dictionaries(
    st.integers(1, 160), st.sampled_from(["lost", "doubled", "doubled late", "late", "foreign", "short", "wrong"])
)


def fate_of(fates: dict[int, str]) -> Fate:
    def fate(number: int, frame: Frame) -> list[tuple[float, Frame]]:
        match fates.get(number):
            case "lost":
                return []
            case "doubled":
                return [(0.0, frame), (0.0, frame)]
            case "doubled late":
                return [(0.0, frame), (0.03, frame)]
            case "late":
                return [(0.06, frame)]
            case "foreign":
                return [(0.0, Frame(frame.can_id, frame.data, extended=True)), (0.001, frame)]
            case "short":
                return [(0.0, Frame(frame.can_id, frame.data[:3])), (0.001, frame)]
            case "wrong":
                return [(0.0, Frame(frame.can_id, bytes([frame.data[0] ^ 0x1F]) + frame.data[1:])), (0.001, frame)]
        return [(0.0, frame)]

    return fate


def session_on(bus: VirtualTimeBus) -> Session:
    return Session(Options(yes=True), open_bus=lambda _options: bus)


def found(bus: VirtualTimeBus) -> list[tuple[LssAddress, bool]]:
    with session_on(bus) as session, LssMaster(bus) as master:
        return [(node.address, node.confirmed) for node in scanned(session, master)]


def scan_requests(nodes: list[StrictDevice]) -> tuple[int, int]:
    """How many frames a scan takes that finds *nodes*, and how many of them are of the fast scan."""
    bus = VirtualTimeBus(nodes, simulated=False)
    frames: list[bytes] = []
    bus.tap(lambda frame, sent: frames.append(frame.data) if sent and frame.can_id == LSS_REQUEST_ID else None)
    assert found(bus) == [(address, True) for address in sorted(map(address_of, nodes))]
    assert {one.node_id for one in nodes} == {UNCONFIGURED}
    return len(frames), sum(frame[0] == FAST_SCAN for frame in frames)


def test_ten_nodes_take_the_requests_that_the_standard_needs() -> None:
    """CiA 305: each node takes a whole fast scan, and the end is that nobody answers."""
    nodes = [unconfigured(serial) for serial in Random(4711).sample(range(1 << 32), 10)]
    frames, scanning = scan_requests(nodes)
    # behind each node that was found one question tells whether it answers what none can
    needed = len(nodes) * NEEDED + 1 + len(nodes) - 1
    assert scanning <= needed + 2
    assert frames <= 1.5 * needed


def test_a_node_that_answers_for_its_serial_number_first_is_not_one_that_answers_everything() -> None:
    """It fits one half of the numbers, and not both: every branch would take twice the requests."""
    nodes = [unconfigured(serial) for serial in (0x1234_5678, 0x7FFF_FFFF)]
    for one in nodes:
        takes_the_parts_in_any_order(one)
    # two questions tell that, and that nobody else is there is asked three times
    assert scan_requests(nodes)[1] <= 2 * NEEDED + 2 + 3


def takes_the_parts_in_any_order(one: StrictDevice) -> None:
    """Without the order of CiA 305: vendor, product, revision, serial number."""
    handle = one.lss.handle

    def answer(request: bytes) -> bytes | None:
        if request[0] == FAST_SCAN and request[5] < BITS:
            one.lss._scanned = request[6]
        return handle(request)

    one.lss.handle = answer  # type: ignore[method-assign]


def test_nobody_is_said_within_two_seconds() -> None:
    bus = VirtualTimeBus([unconfigured(1, node_id=1)], simulated=False)
    assert found(bus) == []
    assert bus.now_s() < 2


@given(FATES)
def test_what_is_found_is_there(fates: dict[int, str]) -> None:
    nodes = [unconfigured(serial) for serial in (0x80000001, 0x7FFFFFFF)]
    try:
        rows = found(LossyBus(nodes, fate_of(fates)))
    except NoAnswer:
        return
    there = {address_of(one) for one in nodes}
    assert {address for address, confirmed in rows if confirmed} <= there
    if all(confirmed for _, confirmed in rows) and len(rows) == 2:
        assert {address for address, _ in rows} == there


@pytest.mark.parametrize("what", ["lost", "doubled", "doubled late", "late", "foreign", "short", "wrong"])
@pytest.mark.parametrize("number", [1, 2, 34, 70, 120])
def test_one_bad_answer_spoils_nothing(what: str, number: int) -> None:
    nodes = [unconfigured(serial) for serial in (0x80000001, 0x7FFFFFFF)]
    assert {address for address, _ in found(LossyBus(nodes, fate_of({number: what})))} == set(map(address_of, nodes))


def test_a_bus_that_answers_everything_is_no_node() -> None:
    bus = LossyBus([], lambda _number, frame: [(0.0, frame)])
    yes = Frame(0x7E4, bytes([IDENTIFIED]).ljust(8, b"\0"))
    bus.tap(lambda frame, sent: bus.nodes_said(yes) if sent and frame.can_id == LSS_REQUEST_ID else None)
    assert [confirmed for _, confirmed in _all_or_nothing(bus)] in ([], [False])


def _all_or_nothing(bus: VirtualTimeBus) -> list[tuple[LssAddress, bool]]:
    try:
        return found(bus)
    except NoAnswer:
        return []


@given(
    st.dictionaries(st.integers(1, 12), st.sampled_from(["lost", "doubled", "late", "wrong"])),
    st.sampled_from([3, 255]),
)
def test_a_node_id_that_was_given_is_there(fates: dict[int, str], before: int) -> None:
    one = unconfigured(7, node_id=before)
    bus = LossyBus([one], fate_of(fates))
    state = _state_after(bus, address_of(one))
    assert one.node_id == 9 or state != "done"
    assert one.node_id == one.lss.pending == before or state not in ("unchanged", "rolled_back")
    assert one.lss.stored == before


def _state_after(bus: VirtualTimeBus, address: LssAddress) -> str:
    """What is said of the node once it should have node-ID 9."""
    try:
        with session_on(bus) as session:
            lss_node_id(session, 9, address)
    except DvtcliError as failed:
        return failed.state
    return "done"


def test_several_that_are_configured_are_refused() -> None:
    bus = VirtualTimeBus([unconfigured(1), unconfigured(2)], simulated=False)
    bus.send(Frame(LSS_REQUEST_ID, bytes([0x04, 1]).ljust(8, b"\0")))
    with LssMaster(bus) as master, pytest.raises(DeviceRefused, match="several nodes"):
        master.inquire()


def test_a_store_that_was_answered_is_not_waited_for() -> None:
    bus = VirtualTimeBus([unconfigured(7, node_id=5)], simulated=False)
    with LssMaster(bus) as master:
        assert master.select(address_of(bus.nodes[0].device)) == 1
        began_s = bus.now_s()
        master.store()
        assert bus.now_s() - began_s < 0.1


def test_nodes_of_this_process_are_not_waited_for_as_on_a_line() -> None:
    bus = VirtualTimeBus([unconfigured(serial) for serial in (1, 2, 3)])
    with session_on(bus) as session, LssMaster(bus) as master:
        assert len(scanned(session, master)) == 3
    assert bus.now_s() < 1
