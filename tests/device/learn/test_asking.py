"""How one PDO is asked: what is sent for it, how often, and what is taken for an answer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from dvtcli.device.learn.probing import Asking
from dvtcli.device.node import Node
from dvtcli.device.read_pdos import read_pdo
from dvtcli.domain.learning.conclusions import most_writes
from dvtcli.domain.learning.probe import (
    IN_PRE_OPERATIONAL,
    Probe,
    ProbeAnswer,
    ProbedPdo,
    ProbeWrite,
    Stand,
    while_operational,
)
from dvtcli.domain.learning.probe_table import KnownAnswers, next_probes
from dvtcli.domain.pdo import Pdo, PdoMappingEntry
from dvtcli.errors import DeviceRefused, SafetyRefusal, SdoAborted
from tests.laws.bench import NODE, DirectBus, DirectSdo, booted, dictionary

TPDO1 = Pdo.parse("tpdo1")
COB_ID, TYPE, TIMER, COUNT, ENTRY, SECOND = (0x1800, 1), (0x1800, 2), (0x1800, 5), (0x1A00, 0), (0x1A00, 1), (0x1A00, 2)
STATUSWORD, POSITION = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x6064, 0, 32)
OFF, LIVE = (0x8000_0181).to_bytes(4, "little"), (0x181).to_bytes(4, "little")
SPARE = (0x6DE).to_bytes(4, "little")
#: a refusal, and another one
NO, NEVER = 0x0800_0021, 0x0609_0030


@dataclass
class Moody(DirectSdo):
    """A device that answers downloads to a place with these codes, one after the other (0: takes it), then as it is."""

    moods: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def download(self, index: int, sub_index: int, data: bytes, *, timeout_s: float | None = None) -> None:
        code = self.moods[index, sub_index].pop(0) if self.moods.get((index, sub_index)) else 0
        if code:
            self.writes.append((index, sub_index, bytes(data)))
            raise SdoAborted(index, sub_index, code, node=NODE)
        super().download(index, sub_index, data, timeout_s=timeout_s)


def sent(place: tuple[int, int], data: bytes) -> tuple[int, int, bytes]:
    return (*place, data)


def raw(entry: PdoMappingEntry) -> bytes:
    return entry.raw.to_bytes(4, "little")


def asking(cob_id: bytes = OFF, mapped: tuple[PdoMappingEntry, ...] = (), limit: int = 100) -> tuple[Asking, Moody]:
    """TPDO1 as it was booted, with this COB-ID and mapping, about to be asked."""
    device = booted()
    device.set_value(*COB_ID, cob_id)
    for number in (1, 2):
        device.set_value(0x1A00, number, raw(mapped[number - 1]) if len(mapped) >= number else bytes(4))
    device.set_value(*COUNT, bytes([len(mapped)]))
    channel = Moody(device)
    node = Node(DirectBus(device, channel), NODE, dictionary("generic"))
    held = read_pdo(channel, TPDO1)
    parameters = {sub: channel.upload(0x1800, sub) for sub in (2, 3, 5)}
    entries = tuple(int.from_bytes(channel.upload(0x1A00, number), "little") for number in (1, 2))
    subject = ProbedPdo(TPDO1, held, parameters, entries, (STATUSWORD,), spare=(0x6DE, 0x6DF))
    return Asking(node, subject, limit), channel


def probe(stand: Stand, *writes: tuple[tuple[int, int], bytes]) -> Probe:
    return Probe(TPDO1, "it", "it", stand, tuple(ProbeWrite(*place, data) for place, data in writes))


TEN = (TIMER, b"\x0a\0")


def test_a_pdo_that_stands_so_already_is_sent_the_question_only() -> None:
    one, channel = asking()
    for _ in range(2):
        assert one.ask(probe(Stand.EMPTY, (COUNT, b"\0"))).code == 0
    assert channel.writes == [sent(COUNT, b"\0")] * 2
    one, channel = asking(mapped=(STATUSWORD,))
    one.fit = STATUSWORD.raw
    one.ask(probe(Stand.FILLED, (COUNT, b"\1")))
    one.ask(probe(Stand.EMPTY, TEN))
    assert channel.writes == [sent(COUNT, b"\1"), sent(COUNT, b"\0"), sent(*TEN)]


def test_one_that_is_on_is_switched_off_and_emptied_first() -> None:
    one, channel = asking(LIVE, (STATUSWORD, POSITION))
    one.fit = POSITION.raw
    one.ask(probe(Stand.EMPTY, TEN))
    assert channel.writes == [sent(COB_ID, OFF), sent(COUNT, b"\0"), sent(*TEN)]


def test_where_it_is_to_be_on_it_is_filled_and_enabled_on_a_can_id_that_nobody_uses() -> None:
    one, channel = asking()
    one.fit = POSITION.raw
    filled = [sent(ENTRY, raw(POSITION)), sent(COUNT, b"\1")]
    one.ask(probe(Stand.FILLED, (COUNT, b"\1")))
    assert channel.writes == [*filled, sent(COUNT, b"\1")]
    channel.writes.clear()
    for _ in range(2):
        one.ask(probe(Stand.ON, TEN))
    assert channel.writes[:2] == [sent(COUNT, b"\0"), sent(COUNT, b"\1")], "opened, then filled again"
    assert channel.writes[2:4] == [sent(COB_ID, SPARE), sent(*TEN)]
    again = channel.writes[4:]
    assert again[:2] == [sent(COB_ID, OFF), sent(COUNT, b"\0")]
    assert again[2:] == [sent(TIMER, b"\0\0"), sent(COUNT, b"\1"), sent(COB_ID, SPARE), sent(*TEN)]


def test_where_nothing_is_known_to_be_mapped_nothing_is_sent() -> None:
    one, channel = asking()
    answer = one.ask(probe(Stand.FILLED, TEN))
    assert (answer.code, answer.why, channel.writes) == (None, "its mappable objects are unknown", [])


def test_what_the_object_holds_afterwards_is_the_answer() -> None:
    one, channel = asking()
    answer = one.ask(probe(Stand.EMPTY, TEN))
    assert (answer.code, answer.held, answer.kept) == (0, b"\x0a\0", True)
    channel.moods[TIMER] = [0, NO, NO]  # back, then asked
    answer = one.ask(probe(Stand.EMPTY, (TIMER, b"\x0b\0")))
    assert (answer.code, answer.held) == (NO, b"\0\0")


@pytest.mark.parametrize(
    ("moods", "code", "writes"),
    [
        ([0], 0, 1),
        ([NO, NO], NO, 2),
        ([NO, 0, NO, NO], NO, 4),
        ([NO, NEVER, 0], 0, 3),
        ([NO, NEVER, NO, NEVER], None, 4),
        ([NO, 0, NO, 0], None, 4),
    ],
)
def test_a_refusal_counts_where_it_is_given_twice(moods: list[int], code: int | None, writes: int) -> None:
    one, channel = asking()
    channel.moods[COUNT] = moods
    answer = one.ask(probe(Stand.EMPTY, (COUNT, b"\0")))
    assert answer.code == code
    assert channel.writes == [sent(COUNT, b"\0")] * writes
    if code is None:
        assert answer.why == "it was refused with 0x08000021, and then not, or with another code"


@pytest.mark.parametrize(("moods", "asked"), [([], True), ([NO], True), ([NO, NEVER], False)])
def test_without_what_comes_before_it_there_is_no_answer(moods: list[int], asked: bool) -> None:
    one, channel = asking(LIVE)
    channel.moods[COB_ID] = [*moods]
    answer = one.ask(probe(Stand.EMPTY, TEN))
    assert answer.code == (0 if asked else None)
    assert (sent(*TEN) in channel.writes) == asked
    assert answer.why == ("" if asked else "0x1800:01 <- 0x80000181 before it was refused with 0x08000021")
    one, channel = asking()
    channel.moods[ENTRY] = [*moods]
    answer = one.ask(probe(Stand.EMPTY, (ENTRY, raw(POSITION)), (COUNT, b"\1")))
    assert (answer.code == 0) == asked


def test_a_restart_ends_the_asking() -> None:
    one, channel = asking()
    assert isinstance(one.node.bus, DirectBus)
    one.node.bus.heard_boot_ups += 1
    with pytest.raises(DeviceRefused, match="node 1 restarted when 0x1800:05 <- 0x000A was written"):
        one.ask(probe(Stand.EMPTY, TEN))
    assert channel.writes == [sent(*TEN)]


def test_no_more_is_written_than_was_announced_and_each_is_told() -> None:
    one, channel = asking(limit=3)
    told: list[int] = []
    one.on_write = lambda: told.append(one.writes)
    for _ in range(3):
        one.ask(probe(Stand.EMPTY, (COUNT, b"\0")))
    with pytest.raises(SafetyRefusal, match="node 1 was written 3 times, the announced maximum"):
        one.ask(probe(Stand.EMPTY, (COUNT, b"\0")))
    assert (len(channel.writes), told, one.writes) == (3, [1, 2, 3], 3)


def test_what_refuses_in_each_state_is_written_no_more_than_was_announced() -> None:
    """Both the COB-ID and an entry, after a count that is taken, twice in OPERATIONAL and twice in PRE-OPERATIONAL."""
    one, channel = asking()
    channel.moods = {place: [NO] * 4 for place in (COB_ID, ENTRY)}
    one.subject = replace(one.subject, parameters={}, entries=(), fits=())
    first = while_operational(one.subject)
    answers = {probe.name: one.ask(probe) for probe in first}
    known = KnownAnswers(one.subject, answers)
    while probes := next_probes(known):
        for probe in probes:
            again = probe.name.endswith(IN_PRE_OPERATIONAL)
            answers[probe.name] = one.ask(probe) if again else ProbeAnswer(probe, None)
    assert [write[:2] for write in channel.writes] == [
        COB_ID, COB_ID, COUNT, COUNT, ENTRY, ENTRY,
        COB_ID, COB_ID, COUNT, ENTRY, ENTRY,
    ]  # fmt: skip
    assert len(channel.writes) <= most_writes(one.subject, first)


@pytest.mark.parametrize(
    ("moods", "parameters", "entries"),
    [
        ({}, {2, 3, 5}, 2),
        ({TIMER: [NO], SECOND: [NO]}, {2, 3, 5}, 2),
        ({TIMER: [NO, NO]}, {2, 3}, 2),
        ({TYPE: [NO, NEVER], SECOND: [NO, NO]}, {3, 5}, 1),
        ({ENTRY: [NO, NO]}, {2, 3, 5}, 0),
    ],
)
def test_what_does_not_take_what_it_holds_is_left_alone(
    moods: dict[tuple[int, int], list[int]], parameters: set[int], entries: int
) -> None:
    one, channel = asking(LIVE, (STATUSWORD, POSITION))
    before, channel.moods = one.subject, {place: [*codes] for place, codes in moods.items()}
    one.keep_to_what_goes_back()
    kept = replace(
        before,
        parameters={sub: data for sub, data in before.parameters.items() if sub in parameters},
        entries=before.entries[:entries],
        more=entries < 2,
    )
    assert one.subject == kept
    assert channel.writes[:2] == [sent(COB_ID, OFF), sent(COUNT, b"\0")]
    twice = sum(len(codes) for codes in moods.values()) - sum(len(codes) == 2 for codes in moods.values())
    tried = 3 + min(entries + 1, 2)
    assert len(channel.writes) == 2 + tried + twice
    if not moods:
        assert channel.writes[-2:] == [sent(ENTRY, raw(STATUSWORD)), sent(SECOND, raw(POSITION))]
