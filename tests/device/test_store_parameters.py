"""Which sub-index takes "save" and "load", what speaks against it, and how a refusal is told."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.cancellation import Cancellation
from dvtcli.device.nmt_gate import NodeAccess
from dvtcli.device.read_pdos import read_identity, service_ids
from dvtcli.device.store.store_parameters import write_signature
from dvtcli.domain.abort import Abort
from dvtcli.domain.objects import RESTORE_PARAMETERS, STORE_PARAMETERS
from dvtcli.domain.profile import GENERIC, StorePolicy
from dvtcli.errors import DeviceRefused, SdoAborted
from tests.device.test_reading_and_storing import Table
from tests.laws.bench import NODE, DirectBus, booted

Place = tuple[int, int]


@dataclass
class Memory(Table):
    """A device whose objects are *values*, which refuses to tell *hidden* ones and takes what it is given."""

    hidden: dict[Place, int] = field(default_factory=dict)
    refuses: int = 0
    taken: list[tuple[int, int, bytes]] = field(default_factory=list)

    def upload(
        self, index: int, sub_index: int, *, timeout_s: float | None = None, retries: int | None = None
    ) -> bytes:
        if (index, sub_index) in self.hidden:
            raise SdoAborted(index, sub_index, self.hidden[index, sub_index], node=NODE)
        return super().upload(index, sub_index)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        if self.refuses:
            raise SdoAborted(index, sub_index, self.refuses, node=NODE)
        self.taken.append((index, sub_index, bytes(data)))


def access(memory: Memory) -> NodeAccess:
    return NodeAccess(DirectBus(booted(), memory), NODE, GENERIC)


def refusal(
    memory: Memory, index: int = STORE_PARAMETERS, sub_index: int | None = None, **policy: object
) -> DeviceRefused:
    with pytest.raises(DeviceRefused) as caught:
        write_signature(access(memory), StorePolicy(**policy), index, sub_index, Cancellation())  # type: ignore[arg-type]
    assert memory.taken == []
    return caught.value


def test_the_first_sub_index_that_there_is_takes_it_or_the_one_that_is_named() -> None:
    memory = Memory({(STORE_PARAMETERS, 3): b"\1\0\0\0", (STORE_PARAMETERS, 1): b"\3\0\0\0"})
    policy = StorePolicy(sub_indices=(2, 3, 1))
    done = write_signature(access(memory), policy, STORE_PARAMETERS, None, Cancellation())
    assert (done.place, done.capability) == ("1010:03", 1)
    assert write_signature(access(memory), policy, STORE_PARAMETERS, 1, Cancellation()).capability == 3
    assert memory.taken == [(STORE_PARAMETERS, 3, b"save"), (STORE_PARAMETERS, 1, b"save")]


def test_one_that_only_takes_values_is_believed_to() -> None:
    memory = Memory({}, hidden={(RESTORE_PARAMETERS, 1): int(Abort.WRITE_ONLY)})
    assert write_signature(access(memory), StorePolicy(), RESTORE_PARAMETERS, None, Cancellation()).capability is None
    assert memory.taken == [(RESTORE_PARAMETERS, 1, b"load")]
    other = Memory({}, hidden={(RESTORE_PARAMETERS, 1): int(Abort.GENERAL)})
    with pytest.raises(SdoAborted):
        write_signature(access(other), StorePolicy(), RESTORE_PARAMETERS, None, Cancellation())


def test_a_restore_asks_for_no_capability() -> None:
    memory = Memory({(RESTORE_PARAMETERS, 1): bytes(4)})
    assert write_signature(access(memory), StorePolicy(), RESTORE_PARAMETERS, None, Cancellation()).capability == 0


@pytest.mark.parametrize(
    ("index", "why", "hint"),
    [
        (STORE_PARAMETERS, "it has no 0x1010:01", "see its manual for storing settings"),
        (RESTORE_PARAMETERS, "it has no 0x1011:01", "see its manual for restoring defaults"),
    ],
)
def test_a_device_without_it_says_what_it_has_not(index: int, why: str, hint: str) -> None:
    error = refusal(Memory({}), index)
    assert (error.why, typed(error.hint), error.abort) == (why, hint, Abort.NO_OBJECT)
    assert refusal(Memory({}), index, sub_indices=()).place == f"{index:04X}:01"
    assert refusal(Memory({}), index, sub_indices=(2, 3)).place == f"{index:04X}:02"


@pytest.mark.parametrize(
    ("capability", "why", "hint"),
    [
        (0, "0x1010:01 is 0: it does not store on command", "see its manual for storing settings"),
        (2, "0x1010:01 is 2: it stores changes by itself", "nothing to do"),
        (4, "0x1010:01 is 4: it does not store on command", "see its manual for storing settings"),
    ],
)
def test_a_device_that_stores_otherwise_says_so(capability: int, why: str, hint: str) -> None:
    error = refusal(Memory({(STORE_PARAMETERS, 1): capability.to_bytes(4, "little")}))
    assert (error.why, typed(error.hint), error.abort) == (why, hint, None)


def test_what_it_has_instead_is_said_of_a_group_too() -> None:
    have = Memory({(STORE_PARAMETERS, 1): b"\1\0\0\0", (RESTORE_PARAMETERS, 1): b"\1\0\0\0"})
    for index, word in ((STORE_PARAMETERS, "store"), (RESTORE_PARAMETERS, "restore")):
        error = refusal(have, index, 2)
        assert error.text == f"this device cannot {word} that group alone"
        assert typed(error.hint) == f"`{word}` alone takes what it has (0x{index:04X}:01)"
    instead = refusal(Memory({}), sub_indices=(), instead="write 2017")
    assert (instead.text, typed(instead.hint)) == ("this device cannot store", "write 2017")
    assert refusal(Memory({}), sub_index=1).text == "this device cannot store"
    assert refusal(Memory({}), sub_index=1, sub_indices=()).text == "this device cannot store"


@pytest.mark.parametrize(
    ("code", "hint", "state"),
    [
        (Abort.DEVICE_STATE, f"`nmt preop {NODE}`, then again", "unchanged"),
        (Abort.HARDWARE, "the device could not write its memory; its earlier stored values may be lost", "unknown"),
        (Abort.GENERAL, None, "unchanged"),
    ],
)
def test_a_refusal_says_what_to_do_and_what_is_certain(code: Abort, hint: str | None, state: str) -> None:
    error = refusal(Memory({(STORE_PARAMETERS, 1): b"\1\0\0\0"}, refuses=int(code)))
    assert (error.text, error.place, error.abort) == (f"node {NODE} refused to store", "1010:01", code)
    assert (typed(error.hint) or None, error.state) == (hint, state)


@pytest.mark.parametrize(
    ("sync", "emcy", "can_ids"),
    [
        (None, None, {(0x080, False), (0x080 + NODE, False)}),
        (0x80, 0x81, {(0x080, False), (0x081, False)}),
        (0x4000_07FF, 0x8000_07FF, {(0x7FF, False)}),  # bit 30: it makes SYNC; bit 31: no EMCY now
        (0x100, 0x690, {(0x100, False), (0x690, False)}),
        (0x2001_2345, 0x2000_0690, {(0x1_2345, True), (0x690, True)}),  # bit 29: 29 bits
    ],
)
def test_the_can_ids_of_sync_and_emcy(sync: int | None, emcy: int | None, can_ids: set[tuple[int, bool]]) -> None:
    rows = {(0x1005, 0): sync, (0x1014, 0): emcy}
    table = Table({place: word.to_bytes(4, "little") for place, word in rows.items() if word is not None})
    assert service_ids(table, NODE, None).keys() == can_ids


def test_a_part_of_the_identity() -> None:
    table = Table({(0x1018, 4): b"\x78\x56\x34\x12"})
    assert read_identity(table, 4) == 0x1234_5678
    assert read_identity(table, 3) is None
