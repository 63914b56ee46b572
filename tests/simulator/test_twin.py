"""A twin of a node: reads go to the node, writes stay here."""

from __future__ import annotations

import pytest

from dvtcli.domain.nmt import NmtState
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.simulator.device.family import GENERIC
from dvtcli.simulator.device.memory import Refusal
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import load_family
from tests.simulator.bench import Aborted, Client, booted


class Node:
    """A real node as far as a twin can tell: a strict device that counts what it is asked."""

    def __init__(self, family: str = "generic") -> None:
        self.device = booted(family)
        self.asked: list[tuple[int, int]] = []

    def upload(self, index: int, sub_index: int) -> bytes:
        self.asked.append((index, sub_index))
        return self.device.upload(index, sub_index)


def twin_of(node: Node, dictionary: ObjectDictionary | None = None, family: str | None = None) -> StrictDevice:
    chosen = load_family(family) if family else GENERIC
    twin = StrictDevice(dictionary or ObjectDictionary({}), chosen, 1, backing=node.upload)
    twin.state = NmtState.PRE_OPERATIONAL
    return twin


def remap(client: Client) -> None:
    for write in (
        (0x1800, 1, 0xC0000181, 4),
        (0x1A00, 0, 0, 1),
        (0x1A00, 1, 0x64010110, 4),
        (0x1A00, 2, 0x606C0020, 4),
        (0x1A00, 0, 2, 1),
        (0x1800, 1, 0x40000181, 4),
    ):
        client.write(*write)


def test_nothing_is_asked_before_it_is_needed() -> None:
    node = Node()
    twin_of(node)
    assert node.asked == []


@pytest.mark.parametrize("with_eds", [False, True])
def test_writes_stay_in_the_twin(with_eds: bool) -> None:
    node = Node()
    client = Client.on(twin_of(node, node.device.dictionary if with_eds else None))
    remap(client)
    assert client.number(0x1A00, 0) == 2
    assert client.number(0x1A00, 2) == 0x606C0020
    assert Client.on(node.device).number(0x1A00, 0) == 1


def test_values_are_the_node_s_until_written() -> None:
    node = Node()
    client = Client.on(twin_of(node))
    assert client.number(0x2003) == 0
    node.device.set_value(0x2003, 0, b"\x07\x00")
    assert client.number(0x2003) == 7
    client.write(0x2003, 0, 9, 2)
    node.device.set_value(0x2003, 0, b"\x08\x00")
    assert client.number(0x2003) == 9


@pytest.mark.parametrize(
    ("write", "code"),
    [
        ((0x1A02, 1, 0x5FFF0010, 4), 0x06020000),
        ((0x1A02, 1, 0x6401FF10, 4), 0x06090011),
        ((0x1A02, 1, 0x60410020, 4), 0x06040041),
        ((0x1A00, 0, 0, 1), 0x06010000),
        ((0x1A02, 9, 0, 4), 0x06090011),
        ((0x1800, 4, 0, 1), 0x06090011),
        ((0x1802, 2, 241, 1), 0x06090030),
        ((0x1802, 1, 0x381, 2), 0x06070013),
    ],
)
def test_without_an_eds_the_node_s_existence_and_the_standard_s_rules_hold(
    write: tuple[int, int, int, int], code: int
) -> None:
    client = Client.on(twin_of(Node()))
    client.write(0x1A02, 0, 0, 1)
    with pytest.raises(Aborted) as caught:
        client.write(*write)
    assert caught.value.code == code


def test_what_nobody_knows_is_not_refused() -> None:
    client = Client.on(twin_of(Node()))
    client.write(0x1A02, 0, 0, 1)
    client.write(0x1A02, 1, 0x20030010, 4)  # not mappable, but only the EDS knows
    client.write(0x1000, 0, 0, 4)  # read-only, but only the EDS knows


def test_a_count_beyond_the_node_s_entries() -> None:
    client = Client.on(twin_of(Node()))
    client.write(0x1A02, 0, 0, 1)
    for sub_index in range(1, 9):
        client.write(0x1A02, sub_index, 0x60000108, 4)
    with pytest.raises(Aborted, match="06040042"):
        client.write(0x1A02, 0, 9, 1)
    client.write(0x1A02, 0, 8, 1)


def test_write_only_objects_exist() -> None:
    client = Client.on(twin_of(Node()))
    client.write(0x2004, 0, 1, 1)
    with pytest.raises(Aborted, match="06010001"):
        Client.on(twin_of(Node())).read(0x2004)


def test_the_dictionary_s_limits_and_access_hold_in_a_twin() -> None:
    node = Node()
    client = Client.on(twin_of(node, node.device.dictionary))
    with pytest.raises(Aborted, match="06090031"):
        client.write(0x2003, 0, 1001, 2)
    with pytest.raises(Aborted, match="06010002"):
        client.write(0x1000, 0, 0, 4)


def test_a_refusal_of_the_node_is_passed_on() -> None:
    def broken(index: int, sub_index: int) -> bytes:
        raise Refusal(0x06060000)

    twin = StrictDevice(ObjectDictionary({}), GENERIC, 1, backing=broken)
    twin.state = NmtState.PRE_OPERATIONAL
    with pytest.raises(Aborted, match="06060000"):
        Client.on(twin).read(0x2000)


def test_existence_is_asked_once() -> None:
    node = Node()
    twin = twin_of(node)
    for _ in range(3):
        with pytest.raises(Refusal):
            twin.upload(0x5FFF, 0)
    assert node.asked == [(0x5FFF, 0)]


def test_gates_and_logins_of_a_family_hold_in_its_twin() -> None:
    node = Node("gen4")
    node.device.set_value(0x5000, 1, b"\0")
    twin = twin_of(node, node.device.dictionary, "gen4")
    client = Client.on(twin)
    with pytest.raises(Aborted, match="08000000"):
        client.write(0x1801, 1, 0x80000281, 4)
    assert client.number(0x5310) == 8
    client.write(0x5000, 3, 1, 2)
    client.write(0x5000, 2, 0xBEEF, 2)  # the twin cannot know the node's passcodes
    client.write(0x1801, 1, 0x80000281, 4)
    client.write(0x5000, 2, 0, 2)
    assert client.number(0x5000, 1) == 0
    client.write(0x5000, 2, 0xBEEF, 2)
    twin.state = NmtState.OPERATIONAL
    with pytest.raises(Aborted, match="08000000"):
        client.write(0x1801, 1, 0x281, 4)
    assert client.number(0x5310) == 4
    assert Client.on(node.device).number(0x5310) == 0
