"""What is known of a node: asked once, asked anew after whatever could have changed it, and told to whoever follows."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import pytest

from dvtcli.device.known_pdos import PASSING_S, ReadProgress
from dvtcli.device.node import Node
from dvtcli.device.other_producers import producers, producers_of
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import U16, VISIBLE_STRING
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import Access, DeviceInfo, ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.rules.finding import Producer
from dvtcli.errors import SdoAborted, SdoProtocolError
from tests.device.test_reading_and_storing import Table, Values
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary, profile

TPDO1, TPDO2, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2"), Pdo.parse("rpdo1")
TIMER = (0x1800, 5)


@dataclass
class Drive:
    """A simulated drive, its bus, its channel, and the node that stands for it."""

    bus: DirectBus
    channel: DirectSdo
    node: Node

    @classmethod
    def of(cls, family: str = "generic", *, eds: bool = True) -> Drive:
        device = booted(family)
        channel = DirectSdo(device)
        bus = DirectBus(device, channel)
        return cls(bus, channel, Node(bus, NODE, dictionary(family) if eds else None, profile(family)))

    def alters_itself(self, timer_ms: int = 77) -> None:
        """The machine, or somebody unseen, sets another event timer."""
        self.bus.device.set_value(*TIMER, timer_ms.to_bytes(2, "little"))

    @property
    def timer_ms(self) -> int | None:
        return self.node.known_pdo(TPDO1).communication.event_timer


def told(values: Values, **more: object) -> Node:
    """A node that answers from a table."""
    bus = DirectBus(booted(), Table(values))
    return Node(bus, NODE, **more)  # type: ignore[arg-type]


def described(*entries: OdEntry, info: DeviceInfo | None = None) -> ObjectDictionary:
    """A file with these sub-indices."""
    objects = {}
    for index in {entry.index for entry in entries}:
        subs = {entry.sub_index: entry for entry in entries if entry.index == index}
        objects[index] = OdObject(index, "it", 9, subs)
    return ObjectDictionary(objects, info or DeviceInfo(), "it.eds")


IDENTITY = {(0x1018, sub): (0x1111_1111 * sub).to_bytes(4, "little") for sub in (1, 2, 3, 4)}


def test_the_identity_has_four_parts_of_four_bytes() -> None:
    identity = told(IDENTITY).identity()
    assert identity == {"vendor": 0x1111_1111, "product": 0x2222_2222, "revision": 0x3333_3333, "serial": 0x4444_4444}
    assert told({(0x1018, 1): b"\x1e"}).identity() == dict.fromkeys(identity, None) | {"vendor": 0x1E}
    for place in IDENTITY:
        with pytest.raises(SdoProtocolError, match="answered 5 bytes"):
            told({**IDENTITY, place: b"\1\2\3\4\5"}).identity()


def test_a_node_is_called_as_in_its_file_or_as_its_family() -> None:
    assert told({}).title == GENERIC.title
    assert told({}, dictionary=described()).title == GENERIC.title
    named = described(OdEntry(0x1000, 0, "type"), info=DeviceInfo(product_name="Gripper 3"))
    assert told({}, dictionary=named).title == "Gripper 3"


def test_a_length_is_the_files_and_read_only_where_it_does_not_say() -> None:
    short, text = OdEntry(0x2000, 0, "short", U16), OdEntry(0x2001, 0, "text", VISIBLE_STRING)
    values = {(0x2000, 0): bytes(4), (0x2001, 0): b"abc", (0x2002, 0): b"\0"}
    node = told(values, dictionary=described(short, text))
    channel = node.bus.sdo(NODE)
    assert isinstance(channel, Table)
    assert (node.length_of(0x2000, 0), channel.reads) == (16, [])
    assert (node.length_of(0x2001, 0), node.length_of(0x2002, 0), node.length_of(0x2003, 0)) == (24, 8, None)


def test_whoever_follows_a_look_is_told_how_far_it_is_and_no_count_where_there_is_none() -> None:
    seen: list[ReadProgress] = []
    drive = Drive.of()
    drive.node.on_look = seen.append
    total = len(drive.node.present())
    drive.node.known_pdos()
    assert seen[0] == ReadProgress(NODE, 0x1800, 1, 0, total)
    assert {one.done for one in seen} == set(range(total))
    drive.node.upload(0x1017, 0)
    assert seen[-1] == ReadProgress(NODE, 0x1017, 0, 0, 0)


def test_what_was_read_is_not_asked_again_and_pdos_asks_all_the_same() -> None:
    drive = Drive.of()
    first = drive.node.pdos()
    drive.alters_itself()
    asked = len(drive.channel.reads)
    assert drive.node.known_pdos() == first
    assert len(drive.channel.reads) == asked
    assert drive.node.pdos()[TPDO1].communication.event_timer == 77
    assert drive.node.pdo(TPDO1).communication.event_timer == 77


def test_what_was_read_is_kept_to_be_shown_until_nobody_knows_it() -> None:
    drive = Drive.of()
    one = drive.node.known_pdo(TPDO1)
    assert dict(drive.node.last_read) == dict(drive.node.last_seen) == {TPDO1: one}
    all_of_them = dict(drive.node.known_pdos())
    assert dict(drive.node.last_read) == dict(drive.node.last_seen) == all_of_them
    drive.node.read_anew()
    assert (dict(drive.node.last_read), dict(drive.node.last_seen)) == ({}, all_of_them)
    drive.node.mark_unknown()
    assert dict(drive.node.last_seen) == {}


def test_what_it_came_up_with_is_read_for_a_store_that_asks_whether_it_is_needed() -> None:
    drive = Drive.of()
    drive.bus.heard_boot_ups = 1
    held = drive.node.pdos()
    assert drive.node.boot_snapshot.why_not(1, held) == ""


@pytest.mark.parametrize("what", ["commanded", "begin_change", "forget", "read_anew"])
def test_after_what_may_have_changed_it_the_node_is_asked_anew(what: str) -> None:
    drive = Drive.of()
    assert drive.timer_ms != 77
    drive.alters_itself()
    getattr(drive.node, what)()
    assert drive.timer_ms == 77


def test_after_a_command_by_hand_the_gate_does_not_know_the_state() -> None:
    drive = Drive.of("gen4")
    drive.node.gate.enter()
    drive.node.commanded()
    assert not drive.node.gate.entered
    drive.bus.device.state = NmtState.OPERATIONAL
    drive.node.gate.enter()
    assert drive.bus.device.state is NmtState.PRE_OPERATIONAL


def test_a_restart_empties_what_was_read_once() -> None:
    drive = Drive.of()
    drive.node.known_value(0x1017, 0)
    drive.node.identity()
    drive.bus.heard_boot_ups += 1
    drive.alters_itself()
    for _ in range(2):
        drive.node.known_value(*TIMER)
        drive.node.identity()
    assert drive.node.known_value(*TIMER) == b"\x4d\0"
    assert drive.channel.reads.count(TIMER) == 1
    assert [drive.channel.reads.count((0x1018, sub)) for sub in (1, 2, 3, 4)] == [2] * 4


@pytest.mark.parametrize("access", [Access.RO, Access.RW])
def test_a_mapping_is_dynamic_where_its_count_may_be_written(access: Access) -> None:
    count, entry = OdEntry(0x1A00, 0, "count", access=access), OdEntry(0x1A00, 1, "entry", access=Access.RW)
    assert told({}, dictionary=described(count, entry)).is_dynamic(TPDO1) == (access is Access.RW)
    assert told({}, dictionary=described(replace(entry, access=Access.RO))).is_dynamic(TPDO1)
    assert told({}).is_dynamic(TPDO1)


def test_a_neighbour_that_no_longer_tells_a_cob_id_sends_what_it_was_known_to() -> None:
    class Shy(DirectSdo):
        is_shy = False

        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            if self.is_shy and (index, sub_index) == (0x1800, 1):
                raise SdoAborted(index, sub_index, 0x0800_0022)
            return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    device = booted()
    device.set_value(0x1800, 1, (0x181).to_bytes(4, "little"))
    device.set_value(0x1801, 1, (0x281).to_bytes(4, "little"))
    channel = Shy(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    sent = (Producer(NODE, TPDO1, CobId(0x181)), Producer(NODE, TPDO2, CobId(0x281)))
    assert producers([node])[:2] == sent
    channel.is_shy = True
    assert producers([node])[:1] == sent[1:]
    channel.is_shy = False
    node.pdos()
    channel.is_shy = True
    assert producers([node])[:2] == sent


@pytest.mark.parametrize("code", [0x0800_0022, 0x0800_0000, 0x0504_0000])
def test_a_passing_refusal_in_the_cache_hides_no_cob_id(code: int) -> None:
    class ShyOnce(DirectSdo):
        asked = 0

        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            if (index, sub_index) == (0x1800, 1):
                self.asked += 1
                if self.asked == 1:
                    raise SdoAborted(index, sub_index, code)
            return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    device = booted()
    device.set_value(0x1800, 1, (0x181).to_bytes(4, "little"))
    node = Node(DirectBus(device, ShyOnce(device)), NODE, dictionary("generic"))
    with suppress(SdoAborted):
        node.read_cache.upload(0x1800, 1)
    assert producers([node], anew=False)[0] == Producer(NODE, TPDO1, CobId(0x181))


@pytest.mark.parametrize("refusals", [2, 100])
@pytest.mark.parametrize("code", [0x0800_0022, 0x0800_0000, 0x0504_0000])
def test_a_cob_id_refused_for_the_moment_on_a_slow_bus_is_not_missed(code: int, refusals: int) -> None:
    """Other COB-IDs take longer than a refusal may pass."""

    class SlowAndShy(DirectSdo):
        asked = 0

        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            bus.sleep(PASSING_S)
            if (index, sub_index) == (0x1801, 1):
                self.asked += 1
                if self.asked <= refusals:
                    raise SdoAborted(index, sub_index, code)
            return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    device = booted()
    channel = SlowAndShy(device)
    bus = DirectBus(device, channel)
    node = Node(bus, NODE, dictionary("generic"))
    assert (TPDO2 in node.known_cob_ids()) == (refusals == 2)
    channel.asked = refusals
    assert TPDO2 in node.known_cob_ids()


@pytest.mark.parametrize(("code", "is_asked_again"), [(0x0800_0022, True), (0x0504_0000, True), (0x0602_0000, False)])
def test_a_cob_id_refused_for_the_moment_twice_is_asked_for_again(code: int, is_asked_again: bool) -> None:
    class ShyTwice(DirectSdo):
        asked = 0

        def upload(
            self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
        ) -> bytes:
            if (index, sub_index) == (0x1800, 1):
                self.asked += 1
                if self.asked <= 2:
                    raise SdoAborted(index, sub_index, code)
            return super().upload(index, sub_index, timeout_s=timeout_s, retries=retries)

    device = booted()
    device.set_value(0x1800, 1, (0x181).to_bytes(4, "little"))
    channel = ShyTwice(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    assert TPDO1 not in [one.pdo for one in producers([node])]
    channel.asked = max(channel.asked, 2)
    found = producers_of([node], CobId(0x181))
    assert found == ((Producer(NODE, TPDO1, CobId(0x181)),) if is_asked_again else ())


def test_of_what_is_unknown_nothing_that_was_read_before_is_believed() -> None:
    drive = Drive.of()
    before = drive.timer_ms
    drive.alters_itself(78)
    assert drive.timer_ms == before
    drive.node.mark_unknown()
    assert drive.timer_ms == 78


def test_what_was_put_together_of_values_goes_with_any_of_them() -> None:
    """A change of one PDO, a restart, another file: each time the PDO is as the device has it then."""
    drive = Drive.of()
    asked = drive.node
    first = asked.known_pdo(TPDO1)
    assert asked.known_pdos()[TPDO1] == asked.known_enabled_pdos()[TPDO1] == first
    drive.alters_itself(77)
    assert drive.timer_ms == first.communication.event_timer, "nothing that could have changed it was seen"
    asked.read_cache.forget_one(*TIMER)
    assert drive.timer_ms == 77
    drive.alters_itself(78)
    asked.read_cache.forget_objects((TPDO1.communication_index,))
    assert (drive.timer_ms, asked.known_pdos()[TPDO1].communication.event_timer) == (78, 78)
    drive.alters_itself(79)
    asked.forget()
    assert (asked.known_enabled_pdos()[TPDO1].communication.event_timer, drive.timer_ms) == (79, 79)
    cob_ids = asked.known_cob_ids()
    asked.describe(None)
    assert dict(asked.known_cob_ids()) == dict(cob_ids)
    drive.bus.device.set_value(TPDO1.communication_index, 1, (0x8000_0181).to_bytes(4, "little"))
    asked.read_anew()
    assert not asked.known_cob_ids()[TPDO1].valid
    assert TPDO1 not in asked.known_enabled_pdos()
