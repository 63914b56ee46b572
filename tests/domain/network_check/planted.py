"""Faults planted in a sound network, with the rule that has to find each; and the sound network itself.

A drive (1), an I/O node (5) and a manager (10) that sends SYNC: every rule has its fault, most have several.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.datatypes import BY_SHORT_NAME, U8, U16, U32
from dvtcli.domain.network.check.checked_network import CheckedNetwork
from dvtcli.domain.network.network_config import MasterRole
from dvtcli.domain.network.network_state import NetworkState, NodeState
from dvtcli.domain.network.received_traffic import ReceivedTraffic
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import Access, DeviceInfo, ObjectDictionary, ObjectType, OdEntry, OdObject
from dvtcli.domain.pdo import Direction, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.domain.ports import Frame
from dvtcli.domain.profile import GENERIC, BitPolicy, Severity

BIT_RATE = 500_000
I16 = BY_SHORT_NAME["i16"]
Change = Callable[[NetworkState], NetworkState]


def _object(index: int, name: str, kind: Any, access: Access, mappable: bool = True) -> OdObject:
    entry = OdEntry(index, 0, name, kind, access, mappable)
    return OdObject(index, name, ObjectType.VAR, {0: entry})


DICTIONARY = ObjectDictionary(
    {
        0x6041: _object(0x6041, "Statusword", U16, Access.RO),
        0x6040: _object(0x6040, "Controlword", U16, Access.RW),
        0x6077: _object(0x6077, "Torque", I16, Access.RO),
        0x6071: _object(0x6071, "Target torque", I16, Access.RW),
        0x6042: _object(0x6042, "Word target", U16, Access.RWW),
        0x6061: _object(0x6061, "Mode", U8, Access.RO),
        0x6060: _object(0x6060, "Wanted mode", U8, Access.RWW),
        0x6502: _object(0x6502, "Modes", U32, Access.RO, mappable=False),
    },
    DeviceInfo(vendor_id=0x1E, product_code=7),
)


def entry(index: int, bits: int = 16) -> PdoMappingEntry:
    """An entry of a mapping, sub-index 0."""
    return PdoMappingEntry(index, 0, bits)


def pdo(
    can_id: int,
    *entries: PdoMappingEntry,
    kind: int = 255,
    inhibit: int = 0,
    timer: int = 0,
    start: int = 0,
    **bits: bool,
) -> PdoConfig:
    """An enabled PDO; inhibit time in 100 µs, event timer in ms."""
    return PdoConfig(PdoCommunicationParameter(CobId(can_id, **bits), kind, inhibit, timer, start), entries)


T1, T2, T3, T6, R1, R2 = map(Pdo.parse, ("tpdo1", "tpdo2", "tpdo3", "tpdo6", "rpdo1", "rpdo2"))
_IDENTITY = {(0x1018, 1): 0x1E, (0x1018, 2): 7}


def _node(node_id: int, pdos: dict[Pdo, PdoConfig], **numbers: int) -> NodeState:
    """Objects as `x1017=500`."""
    held = {(int(name[1:5], 16), int(name[6:] or "0", 16)): value for name, value in numbers.items()}
    held = {(0x1005, 0): 0x80, (0x1014, 0): 0x80 + node_id, (0x1017, 0): 500, **_IDENTITY, **held}
    return NodeState(node_id, f"n{node_id}", pdos, held, DICTIONARY)


SOUND = NetworkState(
    (
        _node(
            1,
            {
                T1: pdo(0x181, entry(0x6040), entry(0x6071), kind=1),
                R1: pdo(0x185, entry(0x6040), entry(0x6060, 8)),
            },
            x1016_01=5 << 16 | 1500,
        ),
        _node(
            5,
            {
                T1: pdo(0x185, entry(0x6040), entry(0x6061, 8), inhibit=100, timer=50),
                R1: pdo(0x181, entry(0x6040), entry(0x6071), kind=1),
            },
            x1016_01=1 << 16 | 1500,
        ),
        _node(10, {}, x1005=0x4000_0080, x1006=10_000, x1007=5_000, x1F80=1, x1F81_01=1, x1F81_05=1, x1F85_01=0x1E),
    )
)


def node(node_id: int, /, **changes: Any) -> Change:
    """Another node *node_id*: fields of `NodeState`."""

    def changed(state: NetworkState) -> NetworkState:
        nodes = (replace(one, **changes) if one.node_id == node_id else one for one in state.nodes)
        return state._replace(nodes=tuple(nodes))

    return changed


def holds(node_id: int, **numbers: int) -> Change:
    """Node *node_id* holds other values: `x1017=0`."""

    def changed(state: NetworkState) -> NetworkState:
        given = {(int(name[1:5], 16), int(name[6:] or "0", 16)): value for name, value in numbers.items()}
        held = next(one for one in state.nodes if one.node_id == node_id).numbers
        return node(node_id, numbers={**held, **given})(state)

    return changed


def lacks(node_id: int, index: int) -> Change:
    """Node *node_id* has no object *index*."""

    def changed(state: NetworkState) -> NetworkState:
        held = next(one for one in state.nodes if one.node_id == node_id).numbers
        return node(node_id, numbers={place: value for place, value in held.items() if place[0] != index})(state)

    return changed


def has(node_id: int, which: Pdo, config: PdoConfig) -> Change:
    """Node *node_id* has this PDO."""

    def changed(state: NetworkState) -> NetworkState:
        pdos = next(one for one in state.nodes if one.node_id == node_id).pdos
        return node(node_id, pdos={**pdos, which: config})(state)

    return changed


def also(*changes: Change) -> Change:
    """All of *changes*."""

    def changed(state: NetworkState) -> NetworkState:
        for change in changes:
            state = change(state)
        return state

    return changed


def master(**role: Any) -> Change:
    """A master is named."""
    return lambda state: state._replace(master=MasterRole(**role))


def same(state: NetworkState) -> NetworkState:
    """No change."""
    return state


#: How long the sound network is listened to, in seconds.
HEARD_S = 3.0


def _each(period_s: float, can_id: int, data: bytes, first_s: float = 0.001) -> list[Frame]:
    times = (first_s + number * period_s for number in range(int(HEARD_S / period_s)))
    return [Frame(can_id, data, timestamp_s=1 + at_s) for at_s in times]


_RUNS = bytes([NmtState.OPERATIONAL])
#: What the sound network sends: SYNC, heartbeats, a TPDO with each SYNC, one every 50 ms.
_SOUND_FRAMES = (
    *_each(0.01, 0x080, b""),
    *_each(0.01, 0x181, bytes(4), 0.002),
    *_each(0.05, 0x185, bytes(3)),
    *(frame for node_id in (1, 5, 10) for frame in _each(0.5, 0x700 + node_id, _RUNS)),
)


def hears(*more: Frame, without: int | None = None, error_frames: int = 0) -> Callable[[], ReceivedTraffic]:
    """What the sound network sends and *more*, *without* a CAN-ID."""

    def received() -> ReceivedTraffic:
        traffic = ReceivedTraffic(HEARD_S, error_frames)
        frames = [frame for frame in _SOUND_FRAMES if frame.can_id != without]
        for frame in sorted([*frames, *more], key=lambda one: one.timestamp_s):
            traffic.add(frame)
        return traffic

    return received


def concise(*entries: tuple[int, int, int, int]) -> bytes:
    """A concise DCF: index, sub-index, length and value of each entry."""
    parts = (index.to_bytes(2, "little") + bytes([sub]) + size.to_bytes(4, "little") + value.to_bytes(size, "little")
             for index, sub, size, value in entries)  # fmt: skip
    return len(entries).to_bytes(4, "little") + b"".join(parts)


class Planted(NamedTuple):
    """A fault, and the rule that finds it: in what nodes hold, in what is *received*, or in who is *present*."""

    rule: str
    change: Change = same
    received: Callable[[], ReceivedTraffic] | None = None
    present: frozenset[int] | None = None
    bit_rate: int | None = BIT_RATE

    @property
    def network(self) -> CheckedNetwork:
        """The network with the fault."""
        traffic = None if self.received is None else self.received()
        return CheckedNetwork(self.change(SOUND), self.bit_rate, traffic, self.present)


_NO_RTR = dict.fromkeys(Direction, BitPolicy.SET)
_STATUS, _CONTROL, _MODE = entry(0x6041), entry(0x6040), entry(0x6061, 8)
_PART = PdoConfig(PdoCommunicationParameter(CobId(0x281), 255), (), unread=((0x1A01, 0),))


def _sends(can_id: int, **more: Any) -> Change:
    """Node 5 sends one more TPDO, which comes every 100 ms at most."""
    return has(5, T2, pdo(can_id, _STATUS, inhibit=1000, timer=200, **more))


def _hears(can_id: int, *entries: PdoMappingEntry, **more: Any) -> Change:
    """Node 5 hears one more RPDO."""
    return has(5, R2, pdo(can_id, *(entries or (entry(0x6042),)), **more))


def _synchronous(count: int) -> Change:
    """Node 5 sends *count* long frames with each SYNC, and has a window of 0.5 ms for that."""
    entries = [entry(0x6041)] * 4
    more = [has(5, Pdo.parse(f"tpdo{10 + one}"), pdo(0x300 + one, *entries, kind=1)) for one in range(count)]
    return also(*more, holds(5, x1007=500))


def _fast(count: int, inhibit: int) -> Change:
    """Node 5 sends *count* long frames, each so often (100 µs)."""
    entries = [entry(0x6041)] * 4
    return also(*(
        has(5, Pdo.parse(f"tpdo{20 + one}"), pdo(0x320 + one, *entries, inhibit=inhibit)) for one in range(count)
    ))  # fmt: skip


PLANTED = (
    Planted("one-producer", _sends(0x181)),
    Planted("one-producer", has(1, T2, pdo(0x181, _STATUS, inhibit=1000))),
    Planted("can-id-of-nmt", _sends(0x000)),
    Planted("can-id-of-sdo", _sends(0x581)),
    Planted("can-id-of-sdo", _hears(0x605)),
    Planted("can-id-of-heartbeat", _sends(0x705)),
    Planted("can-id-of-lss", _sends(0x7E5)),
    Planted("can-id-reserved", _sends(0x07F)),
    Planted("can-id-reserved", _sends(0x101)),
    Planted("can-id-reserved", _sends(0x6E0)),
    Planted("can-id-of-sync", _sends(0x080)),
    Planted("can-id-of-sync", also(holds(10, x1005=0x4000_0300), _hears(0x300))),
    Planted("can-id-of-emcy", _sends(0x081)),
    Planted("can-id-of-emcy", also(holds(1, x1014=0x2A0), _sends(0x2A0))),
    Planted("can-id-of-time", also(holds(10, x1012=0x4000_0100), _sends(0x100))),
    Planted("emcy-twice", holds(5, x1014=0x081)),
    Planted("emcy-can-id", holds(5, x1014=0x080)),
    Planted("emcy-can-id", holds(5, x1014=0x581)),
    Planted("emcy-of-other", holds(5, x1014=0x09B)),
    Planted("emcy-of-other", holds(5, x1014=0x0FF)),
    Planted("sync-can-id", holds(10, x1005=0x4000_0700 | 1)),
    Planted("sync-ids-differ", holds(5, x1005=0x90)),
    Planted("time-ids-differ", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x8000_0110))),
    Planted("two-times", also(holds(10, x1012=0x4000_0100), holds(5, x1012=0x4000_0100))),
    Planted("can-id-of-other", has(5, T2, pdo(0x281, _STATUS, inhibit=1000))),
    Planted("other-formula", also(node(5, node_id=40), has(40, T6, pdo(0x1C8, _STATUS, inhibit=1000)))),
    Planted("node-id-of-master", master(node_id=5)),
    Planted("rpdo-without-producer", _hears(0x333)),
    Planted("tpdo-without-consumer", _sends(0x333)),
    Planted("own-tpdo", _hears(0x185)),
    Planted("frame-format", _hears(0x181, extended=True)),
    Planted("heard-twice", has(5, R2, pdo(0x181, _CONTROL, entry(0x6071), kind=1))),
    Planted("frame-too-short", has(5, R1, pdo(0x181, _CONTROL, entry(0x6071), entry(0x6042), kind=1))),
    Planted("frame-too-long", has(5, R1, pdo(0x181, _CONTROL, kind=1))),
    Planted("layout", has(5, R1, pdo(0x181, entry(0x6060, 8), _CONTROL, entry(5, 8), kind=1))),
    Planted("part-of-object", has(5, R1, pdo(0x181, entry(0x6060, 8), entry(5, 8), entry(0x6071), kind=1))),
    Planted("data-type", has(5, R1, pdo(0x181, _CONTROL, entry(0x6042), kind=1))),
    Planted("hears-no-command", has(1, T1, pdo(0x181, _STATUS, entry(0x6071), kind=1))),
    Planted("hears-no-target", has(1, T1, pdo(0x181, _CONTROL, entry(0x6077), kind=1))),
    Planted("sends-nothing", has(5, T2, pdo(0x333, inhibit=1000))),
    Planted("takes-nothing", has(5, R1, pdo(0x181, kind=1))),
    Planted("takes-nothing", has(5, R1, pdo(0x181, entry(6), entry(6), kind=1))),
    Planted("no-whole-pdo", has(5, T2, _PART)),
    Planted("too-long", has(5, T2, pdo(0x333, *[_STATUS] * 5, inhibit=1000))),
    Planted("one-object-two-writers", has(5, R2, pdo(0x333, _CONTROL))),
    Planted("synchronous-consumer", has(1, T1, pdo(0x181, _STATUS, entry(0x6077), inhibit=100))),
    Planted("sync-not-produced", also(holds(10, x1005=0x80), master(node_id=127, sync_period_us=0))),
    Planted("sync-from-elsewhere", holds(10, x1005=0x80)),
    Planted("sync-from-elsewhere", also(holds(10, x1005=0x80), master(bit_rate=250_000))),
    Planted("two-syncs", holds(5, x1005=0x4000_0080, x1006=10_000)),
    Planted("two-syncs", master(node_id=127, sync_period_us=10_000)),
    Planted("sync-without-period", holds(10, x1006=0)),
    Planted("sync-window", _synchronous(4)),
    Planted("window-over-period", holds(10, x1007=10_000)),
    Planted("sync-start-without-counter", has(1, T1, pdo(0x181, _STATUS, entry(0x6077), kind=4, start=2))),
    Planted("sync-start-over-counter", also(
        holds(10, x1019=4), has(1, T1, pdo(0x181, _STATUS, entry(0x6077), kind=4, start=5)))),
    Planted("sync-counters-differ", also(holds(10, x1019=4), holds(5, x1019=8))),
    Planted("synchronous-without-sync", lacks(5, 0x1005)),
    Planted("reserved-type", has(1, T1, pdo(0x181, _STATUS, entry(0x6077), kind=245))),
    Planted("reserved-type", has(5, R1, pdo(0x181, _CONTROL, entry(0x6071), kind=252))),
    Planted("sent-on-request", has(1, T1, pdo(0x181, _STATUS, entry(0x6077), kind=253))),
    Planted("heartbeat-not-sent", holds(1, x1017=0)),
    Planted("heartbeat-not-sent", also(
        holds(5, x1016_02=127 << 16 | 500), master(node_id=127, heartbeat_producer_ms=0))),
    Planted("heartbeat-of-nobody", holds(5, x1016_02=77 << 16 | 500)),
    Planted("heartbeat-too-short", holds(5, x1016_01=1 << 16 | 500)),
    Planted("heartbeat-margin", holds(5, x1016_01=1 << 16 | 700)),
    Planted("heartbeat-twice", holds(5, x1016_02=1 << 16 | 2000)),
    Planted("heartbeat-of-itself", holds(5, x1016_02=5 << 16 | 1500)),
    Planted("heartbeat-node-id", holds(5, x1016_02=200 << 16 | 1500)),
    Planted("no-error-control", holds(10, x1017=0)),
    Planted("heartbeat-and-guarding", holds(5, x100C=100, x100D=3)),
    Planted("half-guarding", holds(5, x100C=100, x100D=0)),
    Planted("guarding", holds(10, x1017=0, x100C=100, x100D=3)),
    Planted("unwatched-link", holds(5, x1016_01=0)),
    Planted("goes-on-after-error", holds(5, x1029_01=1)),
    Planted("deadline-below-period", has(1, R1, pdo(0x185, _CONTROL, entry(0x6060, 8), timer=50))),
    Planted("deadline-below-period", has(5, R1, pdo(0x181, _CONTROL, entry(0x6071), kind=1, timer=10))),
    Planted("deadline-without-timer", also(
        has(1, R1, pdo(0x185, _CONTROL, entry(0x6060, 8), timer=50)),
        has(5, T1, pdo(0x185, _STATUS, _MODE, inhibit=100)))),
    Planted("unbounded-event-pdo", has(5, T1, pdo(0x185, _STATUS, _MODE))),
    Planted("timer-without-inhibit", has(5, T1, pdo(0x185, _STATUS, _MODE, timer=50))),
    Planted("timer-below-inhibit", has(5, T1, pdo(0x185, _STATUS, _MODE, inhibit=1000, timer=50))),
    Planted("bus-overload", _fast(5, 10)),
    Planted("busy-bus", _fast(3, 10)),
    Planted("too-late", _fast(3, 8)),
    Planted("unknown-bit-rate", bit_rate=None),
    Planted("identity", node(1, asked={"vendor": 0x1E, "product": 8})),
    Planted("identity", node(1, asked={"vendor": 0x1F})),
    Planted("eds-identity", holds(1, x1018_02=8)),
    Planted("dcf-node-id", node(1, dictionary=ObjectDictionary(dict(DICTIONARY), DeviceInfo(node_id=3)))),
    Planted("two-managers", holds(5, x1F80=1)),
    Planted("two-managers", master(node_id=127)),
    Planted("slave-missing", holds(10, x1F81_0C=1)),
    Planted("slave-not-assigned", holds(10, x1F81_05=0)),
    Planted("boot-identity", holds(10, x1F85_01=0x1F)),
    Planted("boot-identity", holds(10, x1F86_05=9)),
    Planted("boot-device-type", also(holds(10, x1F84_01=0x192), holds(1, x1000=0x191))),
    Planted("guarded-by-manager", holds(10, x1F81_05=100 << 16 | 3 << 8 | 1)),
    Planted("guarded-by-manager", holds(10, x1F83_05=1)),
    Planted("manager-misses", holds(10, x1F82_05=1)),
    Planted("boot-time", holds(10, x1F81_05=9, x1F89=400)),
    Planted("concise-dcf-form", node(10, downloads={5: b"\1\0\0\0\0"})),
    Planted("concise-dcf-form", node(10, downloads={5: concise((0x1017, 0, 2, 500)) + b"\0"})),
    Planted("concise-dcf", node(10, downloads={5: concise((0x1017, 0, 2, 700))})),
    Planted("concise-dcf", node(10, downloads={5: concise((0x1800, 1, 4, 0x8000_0185), (0x1800, 5, 2, 20))})),
    Planted("concise-dcf", node(10, downloads={1: concise((0x1A00, 0, 1, 2), (0x1A00, 1, 4, 0x6041_0010), (
        0x1A00, 2, 4, 0x6061_0008))})),
    Planted("nobody-starts", holds(10, x1F80=0)),
    Planted("object-exists", has(5, T2, pdo(0x333, entry(0x6099), inhibit=1000))),
    Planted("direction", has(5, R2, pdo(0x333, _STATUS))),
    Planted("mappable", has(5, T2, pdo(0x333, entry(0x6502, 32), inhibit=1000))),
    Planted("read-write-object", also(
        has(5, T2, pdo(0x333, entry(0x6042), inhibit=1000)),
        node(5, profile=replace(GENERIC, rww_in_tpdo=Severity.WARNING)))),
    Planted("object-for-rpdos", has(5, T2, pdo(0x333, entry(0x6042), inhibit=1000))),
    Planted("granularity", also(_sends(0x333), node(5, profile=replace(GENERIC, granularity=32)))),
    Planted("extended-id", also(_sends(0x333, extended=True), node(5, profile=replace(GENERIC, extended_ids=False)))),
    Planted("rtr-bit", also(_sends(0x333), node(5, profile=replace(GENERIC, rtr_bit=_NO_RTR)))),
    Planted("entry-length", has(5, T2, pdo(0x333, entry(0x6041, 24), inhibit=1000))),
    Planted("dummy-direction", has(5, T2, pdo(0x333, entry(5, 8), _STATUS, inhibit=1000))),
    Planted("dummy-supported", also(
        node(5, profile=replace(GENERIC, dummies=frozenset({5}))), has(5, R2, pdo(0x333, entry(0x6042), entry(6))))),
    Planted("dummy-length", has(5, R2, pdo(0x333, entry(5, 16)))),
    Planted("double-target", has(5, R2, pdo(0x333, entry(0x6042), entry(0x6042)))),
    Planted("can-id-length", has(5, T2, pdo(0x1333, _STATUS, inhibit=1000))),
    Planted("sync-not-heard", received=hears(without=0x080)),
    Planted("sync-heard-twice", received=hears(*_each(0.01, 0x080, b"", 0.004))),
    Planted("sync-heard-twice", holds(10, x1006=0), hears(*_each(0.02, 0x080, b"\7", 0.004))),
    Planted("sync-heard-twice", holds(10, x1006=0), hears(
        *(Frame(0x080, bytes([1 + n // 2]), timestamp_s=1 + n / 100) for n in range(20)), without=0x080)),
    Planted("sync-uneven", holds(10, x1006=0), hears(*_each(0.01, 0x080, b"", 0.004))),
    Planted("comes-too-often", received=hears(*_each(0.005, 0x185, bytes(3), 0.003))),
    Planted("other-length", received=hears(*_each(0.5, 0x185, bytes(8), 0.01), without=0x185)),
    Planted("other-length", received=hears(Frame(0x185, bytes(2), timestamp_s=1.5))),
    Planted("not-heard", received=hears(without=0x185)),
    Planted("from-nobody", received=hears(Frame(0x2A0, bytes(8), timestamp_s=2))),
    Planted("from-nobody", received=hears(Frame(0x1_0000, bytes(8), extended=True, timestamp_s=2))),
    Planted("other-master", received=hears(Frame(0x000, b"\1\0", timestamp_s=2))),
    Planted("other-master", received=hears(Frame(0x605, bytes(8), timestamp_s=2))),
    Planted("other-master", received=hears(Frame(0x622, bytes(8), timestamp_s=2))),
    Planted("other-master", received=hears(Frame(0x7E5, bytes(8), timestamp_s=2))),
    Planted("node-id-twice", received=hears(*_each(0.5, 0x705, _RUNS, 0.2))),
    Planted("node-id-twice", received=hears(*_each(1.5, 0x705, b"\x7F", 0.2))),
    Planted("heartbeat-not-heard", received=hears(without=0x705)),
    Planted("heard-not-read", received=hears(*_each(1, 0x709, _RUNS))),
    Planted("restarts", received=hears(Frame(0x705, b"\0", timestamp_s=2))),
    Planted("emergency", received=hears(Frame(0x085, b"\x10\x32\1\0\0\0\0\0", timestamp_s=2))),
    Planted("error-frames", received=hears(error_frames=3)),
    Planted("not-on-the-bus", present=frozenset({1, 10})),
    Planted("not-in-the-file", present=frozenset({1, 5, 10, 11})),
)  # fmt: skip
