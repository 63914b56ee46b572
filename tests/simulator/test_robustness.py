"""Whatever is sent: the server never fails, and its PDOs stay legal."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from dvtcli.domain.nmt import UNCONFIGURED, NmtState
from dvtcli.domain.pdo import DUMMY_BITS
from dvtcli.domain.ports import Frame
from dvtcli.simulator.device.sdo_server import BLOCK_DOWNLOAD, BLOCK_UPLOAD, SdoServer
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.station import SimulatedNode
from tests.drawn_frames import drawn
from tests.simulator.bench import booted

FAMILIES = ["generic", "gen4", "tmcm", "roboteq"]
DEVICES = {family: booted(family) for family in FAMILIES}


def fresh(family: str) -> StrictDevice:
    model = DEVICES[family]
    device = StrictDevice(model.dictionary, model.family, 1)
    device.boot_up()
    return device


INTERESTING = st.sampled_from(
    [
        *(0x60410010, 0x60640020, 0x606C0020, 0x60000108, 0x60410110, 0x60410020, 0x60610008, 0x00050008, 0x60640000),
        *(0x40000181, 0xC0000181, 0x80000181, 0x181, 0x60000181, 0x80000000, 0x40000601, 0x40000382, 0xC0000382),
        *(0, 1, 2, 3, 8, 9, 64, 255),
    ]
)
PDO_WRITES = st.builds(
    lambda index, sub, value, size: (
        bytes([0x23 | (4 - size) << 2])
        + index.to_bytes(2, "little")
        + bytes([sub])
        + (value & (1 << 8 * size) - 1).to_bytes(size, "little").ljust(4, b"\0")
    ),
    st.sampled_from([0x1400, 0x1402, 0x1600, 0x1602, 0x1800, 0x1802, 0x1A00, 0x1A02]),
    st.sampled_from([0, 0, 1, 1, 1, 2, 3, 4, 9]),
    INTERESTING | st.integers(0, 0xFFFFFFFF),
    st.sampled_from([1, 1, 4, 4, 4, 2]),
)
PLACES = st.sampled_from([0x1000, 0x1008, 0x1010, 0x1018, 0x1800, 0x1A00, 0x2002, 0x6041, 0x3000, 0x5000])
MULTIPLEXED = st.builds(
    lambda head, index, rest: bytes([head]) + index.to_bytes(2, "little") + rest,
    st.integers(0, 255),
    PLACES,
    st.binary(min_size=5, max_size=5),
)
ANY_REQUEST = st.binary(max_size=8) | st.binary(min_size=8, max_size=8) | MULTIPLEXED | PDO_WRITES


def number(device: StrictDevice, index: int, sub_index: int) -> int:
    return int.from_bytes(device.value(index, sub_index), "little")


def check_pdos(device: StrictDevice) -> None:
    """Count ≤ entries, sum ≤ 64 bits, and every active entry names an object long enough (or a dummy of an RPDO)."""
    for mapping in device.dictionary:
        if mapping >> 8 not in (0x16, 0x1A):
            continue
        count = number(device, mapping, 0)
        assert count < len(device.dictionary[mapping].entries)
        rows = [number(device, mapping, sub) for sub in range(1, count + 1)]
        assert sum(row & 0xFF for row in rows) <= 64
        if number(device, mapping - 0x200, 1) >> 31 == 0:
            assert rows
            for row in rows:
                check_entry(device, mapping, row)


def check_entry(device: StrictDevice, mapping: int, row: int) -> None:
    index, sub_index, bits = row >> 16, row >> 8 & 0xFF, row & 0xFF
    assert bits > 0
    if index in DUMMY_BITS:
        assert mapping >> 8 == 0x16
        assert bits <= DUMMY_BITS[index]
        return
    entry = device.dictionary.entry(index, sub_index)
    assert entry is not None
    assert entry.pdo_mapping
    assert entry.bits is None or bits <= entry.bits


@settings(max_examples=max(20, settings().max_examples), deadline=None)
@given(st.sampled_from(FAMILIES), st.lists(ANY_REQUEST.filter(lambda it: not begins_a_block(it)), max_size=30))
def test_any_request_is_answered_or_ignored(family: str, requests: list[bytes]) -> None:
    device = fresh(family)
    server = SdoServer(device)
    for request in requests:
        response = server.handle(request)
        if len(request) != 8 or request[0] >> 5 == 4:
            assert response is None
        else:
            assert response is not None
            assert len(response) == 8
    check_pdos(device)


def begins_a_block(request: bytes) -> bool:
    """Whether *request* has the command specifier of a block transfer, whose segments get no answer each."""
    return len(request) == 8 and request[0] >> 5 in (BLOCK_UPLOAD, BLOCK_DOWNLOAD)


@settings(max_examples=max(20, settings().max_examples), deadline=None)
@given(st.sampled_from(FAMILIES), st.lists(ANY_REQUEST, max_size=30))
def test_after_any_requests_an_abort_makes_the_server_free(family: str, requests: list[bytes]) -> None:
    device = fresh(family)
    server = SdoServer(device)
    for request in requests:
        for response in [server.handle(request), *server.take_more()]:
            assert response is None or len(response) == 8
    check_pdos(device)
    server.handle(bytes.fromhex("8000000000000004"))
    assert server.handle(bytes.fromhex("4018100100000000")) == bytes.fromhex("43181001") + device.value(0x1018, 1)


@settings(max_examples=max(20, settings().max_examples), deadline=None)
@given(st.sampled_from(FAMILIES), st.lists(PDO_WRITES, min_size=5, max_size=60))
def test_no_sequence_of_pdo_writes_makes_an_illegal_pdo(family: str, requests: list[bytes]) -> None:
    device = fresh(family)
    server = SdoServer(device)
    for request in requests:
        server.handle(request)
        check_pdos(device)
    device.state = NmtState.OPERATIONAL
    for frame in device.services.sync():
        assert len(frame.data) <= 8


FRAMES = drawn(
    st.sampled_from([0x000, 0x080, 0x100, 0x181, 0x201, 0x301, 0x401, 0x581, 0x601, 0x701]) | st.integers(0, 0x7FF),
    st.binary(max_size=8) | st.sampled_from([b"\x01\x01", b"\x80\x00", b"\x81\x01", b"\x82\x00", b"\x02\x01"]),
    extended=st.booleans(),
    remote=st.booleans(),
)


LSS = st.builds(
    lambda service, rest: Frame(0x7E5, bytes([service]) + rest),
    st.sampled_from([0x04, 0x11, 0x13, 0x15, 0x17, 0x4C, 0x51, 0x5E, *range(0x40, 0x4C), *range(0x5A, 0x5E)]),
    st.sampled_from([b"\x01", b"\0", b"\x05", b"\xff", b"\0\0\0\0\x80"]).map(lambda it: it.ljust(7, b"\0"))
    | st.binary(min_size=7, max_size=7),
)


@settings(max_examples=max(20, settings().max_examples), deadline=None)
@given(st.sampled_from(FAMILIES), st.lists(FRAMES | LSS, max_size=40))
def test_any_frame_leaves_a_node_alive(family: str, frames: list[Frame]) -> None:
    node = SimulatedNode(fresh(family))
    for at_s, frame in enumerate(frames):
        for answer in node.handle(frame) + node.poll(at_s / 10):
            assert len(answer.data) <= 8
    assert node.device.state in NmtState
    assert node.device.node_id in {*range(1, 128), UNCONFIGURED}
