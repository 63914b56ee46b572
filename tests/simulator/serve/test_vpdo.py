"""Virtual PDOs over a link: what is tied together by SDO is copied, both ways, and real PDOs carry it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from dvtcli.domain.nmt import NmtCommand
from dvtcli.domain.ports import Frame
from tests.simulator.serve.link import Link, linked
from tests.simulator.serve.served import PATIENCE_S

NONE = {0x3000: 0x20FF, 0x3100: 0x23FF, 0x3200: 0x24FF, 0x3300: 0x21FF, 0x3400: 0x22FF}


@pytest.fixture(scope="module", params=["gen4", "espac"])
def process(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Link]:
    with linked(tmp_path_factory.mktemp("sim"), f"{request.param}@1") as (server, bus):
        yield Link(server, bus, 1)


@pytest.fixture
def node(process: Link) -> Link:
    """A node whose pins and motors are not linked: VPDOs save themselves, a reset does not untie them."""
    process.restore()
    for selector in NONE:
        tie(process, selector)
    return process


def tie(node: Link, selector: int, *objects: int) -> None:
    """Tie pins 1, 2, … of a group to *objects*; 0 leaves one out."""
    node.client.write(selector, 0, 0, 1)
    for pin, index in enumerate(objects, 1):
        node.client.write(selector, pin, index or NONE[selector], 2)
    node.client.write(selector, 0, len(objects), 1)


def mapped(node: Link, communication: int, cob_id: int, *entries: int) -> None:
    """Map *entries* into the PDO, synchronous and at once."""
    client, mapping = node.client, communication + 0x200
    client.write(communication, 1, 1 << 31 | cob_id, 4)
    client.write(communication, 2, 1 if communication >= 0x1800 else 255, 1)
    client.write(mapping, 0, 0, 1)
    for sub_index, entry in enumerate(entries, 1):
        client.write(mapping, sub_index, entry, 4)
    client.write(mapping, 0, len(entries), 1)
    client.write(communication, 1, cob_id, 4)


def at_sync(node: Link, cob_id: int) -> str:
    """The data of the TPDO on the next SYNC, in OPERATIONAL for so long."""
    node.nmt(NmtCommand.START)
    (data,) = [frame.data for frame in node.sync() if frame.can_id == cob_id]
    node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    return data.hex()


def test_digital_inputs(node: Link) -> None:
    """0x6800:1 is 0x05: pins 1 and 3 are on. 0x6800:2 holds pins 9…16, all off."""
    inputs = (0x2121, 0x2122, 0x2123, 0x2124)
    mapped(node, 0x1800, 0x181, *(index << 16 | 1 for index in inputs))
    assert node.client.number(0x6800, 1) == 0x05
    for tied, wanted in (
        (inputs, [1, 0, 1, 0]),
        (inputs[::-1], [0, 1, 0, 1]),
        ((0x2121, 0, 0x2122), [1, 1, 0, 1]),
        ((*[0] * 8, 0x2121), [0, 1, 0, 1]),
    ):
        tie(node, 0x3300, *tied)
        assert [node.client.number(index) for index in inputs] == wanted
        assert int(at_sync(node, 0x181), 16) == sum(value << bit for bit, value in enumerate(wanted))


def test_analogue_inputs(node: Link) -> None:
    first, second = (node.client.number(0x6C01, pin) for pin in (1, 2))
    assert first != second
    mapped(node, 0x1800, 0x181, 0x22200010, 0x22210010)
    for tied, wanted in (((0x2220, 0x2221), (first, second)), ((0x2221, 0x2220), (second, first))):
        tie(node, 0x3400, *tied)
        assert (node.client.number(0x2220), node.client.number(0x2221)) == wanted
        assert at_sync(node, 0x181) == b"".join(value.to_bytes(2, "little") for value in wanted).hex()


def test_a_tied_pin_wins_over_an_rpdo_and_a_free_one_does_not(node: Link) -> None:
    mapped(node, 0x1400, 0x201, 0x22200010)
    for tied, wanted in (((), 0x1234), ((0x2220,), node.client.number(0x6C01, 1))):
        tie(node, 0x3400, *tied)
        node.nmt(NmtCommand.START)
        node.receive(Frame(0x201, bytes.fromhex("3412")))
        assert node.client.number(0x2220) == wanted
        node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)


def test_digital_outputs(node: Link) -> None:
    """What the application switches off (0x2320 is 0) goes off at its pin alone, whatever an RPDO wants."""
    mapped(node, 0x1400, 0x201, 0x62000108)
    mapped(node, 0x1800, 0x181, 0x62000108)
    for tied, wanted in (((), "ff"), ((0, 0, 0x2320), "fb"), ((0x2320,), "fe")):
        tie(node, 0x3100, *tied)
        node.nmt(NmtCommand.START)
        node.receive(Frame(0x201, b"\xff"))
        assert at_sync(node, 0x181) == wanted
        assert node.client.number(0x6200, 1) == int(wanted, 16)


def test_analogue_outputs(node: Link) -> None:
    """0x2400 is what the application wants of the line contactor, 0x2401 of something that is off."""
    wanted = node.client.number(0x2400)
    assert (wanted > 0, node.client.number(0x2401)) == (True, 0)
    mapped(node, 0x1800, 0x181, 0x6C110110, 0x6C110210)
    for tied, values in (((0x2400, 0x2401), (wanted, 0)), ((0x2401, 0x2400), (0, wanted))):
        tie(node, 0x3200, *tied)
        assert (node.client.number(0x6C11, 1), node.client.number(0x6C11, 2)) == values
        assert at_sync(node, 0x181) == b"".join(value.to_bytes(2, "little") for value in values).hex()


def at_rest(node: Link) -> None:
    """Wait until the motor has the velocity that it should have: until then its objects change between two reads."""
    until_s = time.monotonic() + PATIENCE_S
    while not node.client.number(0x6041) & 0x0400:
        assert time.monotonic() < until_s, "the motor does not come to rest"
        time.sleep(0.01)


def test_motors(node: Link) -> None:
    """Controlword and demands go down to 0x6000…, status and actual values come up, for the motor that is chosen."""
    down, up = {1: 0x6040, 3: 0x60FF, 5: 0x6072}, {2: 0x6041, 4: 0x606C, 6: 0x6077}
    mapped(node, 0x1400, 0x201, 0x60FF0020, 0x60400010)
    node.nmt(NmtCommand.START)
    node.receive(Frame(0x201, bytes.fromhex("640000000600")))
    assert (node.client.number(0x60FF), node.client.number(0x6040)) == (100, 6)
    node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    for motor in (0x2020, 0x2021):
        tie(node, 0x3000, motor)
        mapped(node, 0x1800, 0x181, motor << 16 | 0x0210, motor << 16 | 0x0420)
        at_rest(node)
        for sub_index, profile in (down | up).items():
            assert node.client.number(motor, sub_index) == node.client.number(profile), f"{motor:X}:{sub_index}"
        node.nmt(NmtCommand.START)
        node.receive(Frame(0x201, bytes.fromhex("640000000600")))
        assert node.client.number(0x60FF) == node.client.number(motor, 3) != 100, "the motor's own demand wins"
        node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        at_rest(node)
        status, velocity = node.client.read(0x6041), node.client.read(0x606C)
        assert at_sync(node, 0x181) == (status + velocity).hex()
