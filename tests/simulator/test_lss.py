"""LSS frame by frame: what is asked (0x7E5), what is answered (0x7E4), and what the node is afterwards (CiA 305)."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import UNCONFIGURED, NmtCommand, NmtState
from dvtcli.domain.ports import Frame
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.station import SimulatedNode, stations
from tests.simulator.bench import booted
from tests.virtual_time import VirtualTimeBus

#: vendor, product, revision and serial number of the node
ADDRESS = (0x1E, 0x0705302D, 0x00010008, 0x00C0FFEE)


def node_of(node_id: int = 1, bit_rate: int | None = None, serial: int = ADDRESS[3]) -> SimulatedNode:
    device = StrictDevice(read_eds(family_eds("gen4")).dictionary, load_family("gen4"), node_id)
    for sub_index, number in enumerate((*ADDRESS[:3], serial), 1):
        device.set_value(0x1018, sub_index, number.to_bytes(4, "little"))
    device.boot_up()
    device.take_outbox()
    (node,) = stations([device], bit_rate=bit_rate, known_rates=() if bit_rate is None else (bit_rate,))
    return node


def ask(node: SimulatedNode, *requests: str, now_s: float = 0.0) -> list[str]:
    """What *node* sends on LSS *requests*, in hex, zeros at their ends left out: `7E4 11`."""
    sent = [frame for text in requests for frame in node.handle(request(text), now_s)]
    return [f"{frame.can_id:03X} {frame.data.rstrip(bytes(1)).hex(' ').upper()}".rstrip() for frame in sent]


def request(text: str) -> Frame:
    return Frame(0x7E5, bytes.fromhex(text).ljust(8, b"\0"))


def part(service: int, number: int) -> str:
    return f"{service:02X}{number.to_bytes(4, 'little').hex()}"


def select(*address: int) -> list[str]:
    return [part(0x40 + place, number) for place, number in enumerate(address)]


CONFIGURE, WAIT = "0401", "0400"
SELECT = select(*ADDRESS)
WITHIN = [part(0x46 + place, number) for place, number in enumerate(
    (ADDRESS[0], ADDRESS[1], ADDRESS[2], ADDRESS[2] + 1, ADDRESS[3] - 1, ADDRESS[3])
)]  # fmt: skip

ROWS = [
    # request frames, answers
    pytest.param([CONFIGURE], [], id="switch state global says nothing"),
    pytest.param(["0402", "5E"], [], id="no such state"),
    pytest.param(["5E", "1105", "130002", "17", "5A", "5D"], [], id="a waiting node has nothing to say"),
    pytest.param([CONFIGURE, WAIT, "5E"], [], id="and is so again"),
    pytest.param([CONFIGURE, "5E"], ["7E4 5E 01"], id="node-ID"),
    pytest.param([CONFIGURE, "5A"], ["7E4 5A 1E"], id="vendor-ID"),
    pytest.param([CONFIGURE, "5B"], ["7E4 5B 2D 30 05 07"], id="product code"),
    pytest.param([CONFIGURE, "5C"], ["7E4 5C 08 00 01"], id="revision number"),
    pytest.param([CONFIGURE, "5D"], ["7E4 5D EE FF C0"], id="serial number"),
    pytest.param(SELECT, ["7E4 44"], id="switch state selective"),
    pytest.param([*SELECT, "5E"], ["7E4 44", "7E4 5E 01"], id="and it is configured then"),
    pytest.param([*select(ADDRESS[0] + 1, *ADDRESS[1:]), "5E"], [], id="another vendor"),
    pytest.param([*select(ADDRESS[0], 1, *ADDRESS[2:]), "5E"], [], id="another product"),
    pytest.param([*select(*ADDRESS[:2], 0, ADDRESS[3]), "5E"], [], id="another revision"),
    pytest.param([*select(*ADDRESS[:3], 7), "5E"], [], id="another serial number"),
    pytest.param([*SELECT[:2], SELECT[3], "5E"], [], id="not all of the address"),
    pytest.param([SELECT[3], *SELECT[:3], "5E"], [], id="in another order"),
    pytest.param([*SELECT[:3], SELECT[0], *SELECT[1:]], ["7E4 44"], id="begun again"),
    pytest.param([CONFIGURE, *SELECT], [], id="selected while it is configured"),
    pytest.param(WITHIN, ["7E4 4F"], id="identify remote slave"),
    pytest.param([CONFIGURE, *WITHIN], ["7E4 4F"], id="in both states"),
    pytest.param([*WITHIN[:2], part(0x48, ADDRESS[2] + 1), *WITHIN[3:]], [], id="revision too low"),
    pytest.param([*WITHIN[:3], part(0x49, ADDRESS[2] - 1), *WITHIN[4:]], [], id="revision too high"),
    pytest.param([*WITHIN[:4], part(0x4A, ADDRESS[3] + 1), WITHIN[5]], [], id="serial number too low"),
    pytest.param([*WITHIN[:5], part(0x4B, ADDRESS[3] - 1)], [], id="serial number too high"),
    pytest.param([*WITHIN[:5], *WITHIN[4:]], [], id="a frame twice"),
    pytest.param(["4C"], [], id="a configured node is no non-configured one"),
    pytest.param(["510000000080"], [], id="and takes no part in a fast scan"),
    pytest.param([CONFIGURE, "1105", "5E"], ["7E4 11", "7E4 5E 01"], id="configure node-ID, which is not active yet"),
    pytest.param([CONFIGURE, "11FF"], ["7E4 11"], id="to be without a node-ID"),
    pytest.param([CONFIGURE, "1100"], ["7E4 11 01"], id="node-ID 0"),
    pytest.param([CONFIGURE, "1180"], ["7E4 11 01"], id="node-ID 128"),
    pytest.param([CONFIGURE, "130002"], ["7E4 13 01"], id="a bus without bit timing"),
    pytest.param([CONFIGURE, "150a00", "5E"], ["7E4 5E 01"], id="no bit timing to activate"),
    pytest.param([CONFIGURE, "17"], ["7E4 17"], id="store configuration"),
    pytest.param([CONFIGURE, "00", "7F", "44", "4F", "50", "FF"], [], id="services that are none"),
]


@pytest.mark.parametrize(("requests", "answers"), ROWS)
def test_a_configured_node(requests: list[str], answers: list[str]) -> None:
    assert ask(node_of(), *requests) == answers


@pytest.mark.parametrize("state", [NmtState.STOPPED, NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL])
def test_in_every_nmt_state(state: NmtState) -> None:
    node = node_of()
    node.device.state = state
    assert ask(node, CONFIGURE, "5E") == ["7E4 5E 01"]


def test_frames_that_are_no_requests() -> None:
    node = node_of()
    for frame in (
        Frame(0x7E5, bytes.fromhex("0401")),
        Frame(0x7E5, bytes(8), remote=True),
        request(CONFIGURE)._replace(extended=True),
        request(CONFIGURE)._replace(can_id=0x7E4),
    ):
        assert node.handle(frame) == []
    assert ask(node, "5E") == []


def test_a_new_node_id_counts_from_the_reset_of_communication_on() -> None:
    node = node_of()
    ask(node, CONFIGURE, "1105", WAIT)
    read = Frame(0x601, bytes.fromhex("4018100100000000"))
    assert [frame.can_id for frame in node.handle(read)] == [0x581]
    (boot_up,) = node.handle(Frame(0, bytes([NmtCommand.RESET_COMMUNICATION, 1])))
    assert (boot_up.can_id, boot_up.data) == (0x705, b"\0")
    assert node.handle(read) == []
    assert [frame.can_id for frame in node.handle(read._replace(can_id=0x605))] == [0x585]
    assert node.device.value(0x1800, 1)[:2] == bytes.fromhex("8501"), "the default is 0x180 + node-ID"
    node.device.set_value(0x1017, 0, (100).to_bytes(2, "little"))
    assert [frame.can_id for frame in node.poll(1.0)] == [0x705]


def test_an_emergency_has_the_new_node_id() -> None:
    node = node_of()
    ask(node, CONFIGURE, "1105")
    node.handle(Frame(0, bytes([NmtCommand.RESET_COMMUNICATION, 0])))
    assert [frame.can_id for frame in node.device.services.emergency(0x2310)] == [0x085]


@pytest.mark.parametrize(("stored", "after"), [(False, 0x701), (True, 0x705)])
def test_a_reset_of_the_node_brings_the_stored_node_id(stored: bool, after: int) -> None:
    node = node_of()
    ask(node, CONFIGURE, "1105", *(["17"] if stored else []), WAIT)
    changes = node.device.areas.changes
    node.handle(Frame(0, bytes([NmtCommand.RESET_COMMUNICATION, 1])))
    (boot_up,) = node.handle(Frame(0, bytes([NmtCommand.RESET_NODE, 5])))
    assert boot_up.can_id == after
    assert (node.device.lss.stored == 5) is stored
    assert node.device.areas.changes == changes


def test_storing_is_a_change_to_keep_and_may_fail() -> None:
    node = node_of()
    changes = node.device.areas.changes
    ask(node, CONFIGURE, "1105")
    assert node.device.areas.changes == changes
    node.device.areas.fails = True
    assert ask(node, "17") == ["7E4 17 02"]
    assert (node.device.lss.stored, node.device.areas.changes) == (1, changes)
    node.device.areas.fails = False
    assert ask(node, "17") == ["7E4 17"]
    assert node.device.areas.changes > changes


def test_what_was_kept_is_the_node_id_at_power_on() -> None:
    node = node_of()
    node.device.power_on({}, 9)
    node.device.boot_up()
    assert [frame.can_id for frame in node.device.take_outbox()] == [0x709]


def test_a_reset_ends_the_configuration() -> None:
    node = node_of()
    ask(node, CONFIGURE)
    node.handle(Frame(0, bytes([NmtCommand.RESET_COMMUNICATION, 1])))
    assert ask(node, "5E") == []


def test_a_bus_keeps_its_bit_rate() -> None:
    node = node_of(bit_rate=125_000)
    answers = ask(node, CONFIGURE, *(f"1300{entry:02X}" for entry in range(10)), "130104")
    assert answers == ["7E4 13" if entry == 4 else "7E4 13 01" for entry in range(10)] + ["7E4 13 01"]


def test_activating_the_bit_timing_is_two_delays_of_silence() -> None:
    node = node_of(bit_rate=125_000)
    node.device.set_value(0x1017, 0, (10).to_bytes(2, "little"))
    node.poll(1.0)
    ask(node, CONFIGURE, "130004", "156400", now_s=1.0)  # 100 ms
    assert node.poll(1.15) == []
    assert node.next_poll_s() == pytest.approx(1.2)
    assert ask(node, "5E", now_s=1.19) == []
    assert [frame.can_id for frame in node.poll(1.2)] == [0x701]
    assert ask(node, "5E", now_s=1.2) == ["7E4 5E 01"]


def test_a_node_without_a_node_id_hears_lss_only() -> None:
    node = node_of(UNCONFIGURED)
    assert node.poll(0.0) == []
    assert node.next_poll_s() is None
    for frame in (Frame(0, b"\x01\x00"), Frame(0, b"\x82\x00"), Frame(0x6FF, bytes.fromhex("4018100100000000"))):
        assert node.handle(frame) == []
    assert ask(node, "4C") == ["7E4 50"]
    assert ask(node, CONFIGURE, "5E") == ["7E4 5E FF"]


def test_its_first_node_id_boots_it_when_the_configuration_ends() -> None:
    node = node_of(UNCONFIGURED)
    assert ask(node, CONFIGURE, WAIT, CONFIGURE, "1105") == ["7E4 11"]
    assert ask(node, "4C") == [], "it waits for nobody any more"
    assert ask(node, WAIT) == ["705"]
    assert node.device.state is NmtState.PRE_OPERATIONAL
    assert [frame.can_id for frame in node.handle(Frame(0x605, bytes.fromhex("4018100100000000")))] == [0x585]


def test_a_node_may_lose_its_node_id() -> None:
    node = node_of()
    ask(node, CONFIGURE, "11FF", WAIT)
    assert ask(node, "4C") == []
    assert node.handle(Frame(0, bytes([NmtCommand.RESET_COMMUNICATION, 1]))) == []
    assert node.device.state is NmtState.INITIALISING
    assert ask(node, "4C") == ["7E4 50"]


def scan(node: SimulatedNode, number: int, bit: int, place: int, following: int) -> bool:
    answers = ask(node, f"{part(0x51, number)}{bit:02X}{place:02X}{following:02X}")
    assert answers in ([], ["7E4 4F"])
    return bool(answers)


def received(nodes: list[SimulatedNode], *question: int) -> bool:
    """Ask all of *nodes*; whether one answers."""
    answers = [scan(node, *question) for node in nodes]
    return any(answers)


def found_by_scan(nodes: list[SimulatedNode]) -> list[int] | None:
    """The address that a fast scan finds, as CiA 305 has it: bit by bit from the highest, 0 first."""
    address = []
    if not received(nodes, 0, 0x80, 0, 0):
        return None
    for place in range(4):
        number = 0
        for bit in range(31, -1, -1):
            if not received(nodes, number, bit, place, place):
                number |= 1 << bit
        if not received(nodes, number, 0, place, (place + 1) % 4):
            return None
        address.append(number)
    return address


def test_fast_scan_finds_the_node() -> None:
    node = node_of(UNCONFIGURED)
    assert found_by_scan([node]) == list(ADDRESS)
    assert ask(node, "1107", "5E") == ["7E4 11", "7E4 5E FF"]
    assert ask(node, WAIT) == ["707"]
    assert found_by_scan([node]) is None


def test_fast_scan_finds_the_lowest_of_several_one_after_the_other() -> None:
    serials = [0x30, 0x00C0FFEE, 0x2F]
    nodes = [node_of(UNCONFIGURED, serial=serial) for serial in serials]
    for number, serial in enumerate(sorted(serials), 11):
        assert found_by_scan(nodes) == [*ADDRESS[:3], serial]
        booted_ids = [answer for node in nodes for answer in ask(node, f"11{number:02X}", WAIT)]
        assert booted_ids == ["7E4 11", f"{0x700 + number:03X}"]
    assert found_by_scan(nodes) is None


@pytest.mark.parametrize(("bit", "place", "following"), [(32, 0, 0), (0x7F, 0, 0), (31, 1, 1), (31, 4, 0), (31, 0, 4)])
def test_questions_that_a_fast_scan_does_not_have(bit: int, place: int, following: int) -> None:
    node = node_of(UNCONFIGURED)
    assert scan(node, 0, 0x80, 0, 0)
    assert not scan(node, 0, bit, place, following)


def test_in_virtual_time() -> None:
    bus = VirtualTimeBus([node_of(UNCONFIGURED).device])
    bus.send(request("4C"))
    assert [(frame.can_id, frame.data[0]) for frame in bus.receive(0.1)] == [(0x7E4, 0x50)]
    for text in (CONFIGURE, "1107", WAIT):
        bus.send(request(text))
    assert bus.wait_boot_up(7, 0, 1.0)
    assert bus.sdo(7).upload(0x1018, 1) == ADDRESS[0].to_bytes(4, "little")


def test_a_node_that_resets_hears_no_lss() -> None:
    device = booted()
    device.restart()
    assert device.layer_setting(bytes.fromhex("0401000000000000")) is None
    assert device.layer_setting(bytes.fromhex("5E00000000000000")) is None
