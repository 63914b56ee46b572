"""Who hears a frame and who is due is looked up, and is what a look at every node would find."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import Roster, SimulatedNode, stations
from tests.cli.commands.bus import device

IDS = (1, 2, 3)
#: SYNC, EMCY, PDOs, SDOs, heartbeats, LSS, and what nobody knows
FRAMES = [
    Frame(can_id, b"", remote=remote)
    for can_id in (0x000, 0x080, 0x081, 0x201, 0x202, 0x2A1, 0x581, 0x601, 0x603, 0x604, 0x701, 0x702, 0x7E5, 0x555)
    for remote in (False, True)
]
#: what is done to a device behind everybody's back: an object written by itself, an NMT command, a restart, a boot
HEARTBEAT_OF_1 = (0x0001_0064).to_bytes(4, "little")
DEEDS = (
    *((0x1400, 1, cob_id.to_bytes(4, "little")) for cob_id in (0x201, 0x2A1, 0x8000_0201)),
    (0x1016, 1, HEARTBEAT_OF_1),
    (0x1017, 0, b"\x64\0"),
    (0x1017, 0, b"\0\0"),
    (0x1005, 0, (0x555).to_bytes(4, "little")),
    "start",
    "stop",
    "restart",
    "boot",
    "poll",
    "ask",
)


def done(node: SimulatedNode, deed: object, now_s: float) -> None:
    match deed:
        case (int(index), int(sub_index), bytes(data)):
            node.device.set_value(index, sub_index, data)
            node.device.services.written(index)
        case "start" | "stop":
            node.device.nmt(1 if deed == "start" else 2)
        case "restart":
            node.device.restart()
        case "boot":
            node.device.boot_up()
        case "poll":
            node.poll(now_s)
        case "ask":
            node.handle(Frame(0x600 + node.device.node_id, bytes.fromhex("40 00 10 00 00 00 00 00")), now_s)


def found(nodes: list[SimulatedNode], roster: Roster, now_s: float) -> tuple[object, ...]:
    received = [[node.device.node_id for node in roster.listeners(frame)] for frame in FRAMES]
    return received, roster.next_s(), [node.device.node_id for node in roster.due(now_s)]


def each(devices: list[StrictDevice]) -> list[SimulatedNode]:
    for one in devices:
        one.boot_up()
    return stations(devices)


@given(st.lists(st.tuples(st.sampled_from(range(3)), st.sampled_from(DEEDS), st.sampled_from((0.0, 0.05, 0.2)))))
def test_what_is_looked_up_is_what_a_look_at_all_finds(deeds: list[tuple[int, object, float]]) -> None:
    nodes = each([device("generic", node_id) for node_id in IDS])
    roster, now_s = Roster(nodes), 10.0
    for number, deed, passes_s in deeds:
        now_s += passes_s
        done(nodes[number], deed, now_s)
        if deed in ("poll", "ask"):
            roster.looked_at(nodes[number])
        assert found(nodes, roster, now_s) == found(nodes, Roster(nodes), now_s)
        due_s = [due_s for node in nodes if (due_s := node.next_poll_s()) is not None]
        assert roster.next_s() == min(due_s, default=float("inf"))
