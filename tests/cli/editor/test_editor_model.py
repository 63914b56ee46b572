"""What is edited: steps that can be undone, entries that keep their order, and objects that are offered."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dvtcli.cli.editor.model import PARAMETERS, EditedPdos, ObjectList
from dvtcli.domain.cob_id import CobId
from dvtcli.domain.object_scalings import ObjectScalings
from dvtcli.domain.pdo import Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry
from dvtcli.operations.session.device_files import offline_dictionaries
from dvtcli.operations.user.options import Options

TPDO1, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("rpdo1")
STATUS, SPEED = PdoMappingEntry(0x6041, 0, 16), PdoMappingEntry(0x606C, 0, 32)


def held() -> dict[Pdo, PdoConfig]:
    parameter = PdoCommunicationParameter(CobId(0x181), 255, 0, 0)
    return {pdo: PdoConfig(parameter, (STATUS,)) for pdo in (TPDO1, RPDO1)}


_STEPS: list[Callable[[EditedPdos, Pdo], object]] = [
    lambda pdos, pdo: pdos.insert(pdo, 0, SPEED),
    lambda pdos, pdo: pdos.insert(pdo, len(pdos.now[pdo].mapping), STATUS),
    lambda pdos, pdo: pdos.remove(pdo, 0),
    lambda pdos, pdo: pdos.move(pdo, 0, 1),
    lambda pdos, pdo: pdos.switch(pdo),
    lambda pdos, pdo: pdos.put(pdo, PARAMETERS[1].set(pdos.now[pdo], "1")),
]


@given(st.lists(st.tuples(st.sampled_from(_STEPS), st.sampled_from([TPDO1, RPDO1])), max_size=20))
def test_undo_takes_each_step_back_and_redo_makes_it_again(
    steps: list[tuple[Callable[[EditedPdos, Pdo], object], Pdo]],
) -> None:
    pdos = EditedPdos(held())
    states = [dict(pdos.now)]
    for step, pdo in steps:
        step(pdos, pdo)
        if pdos.now != states[-1]:
            states.append(dict(pdos.now))
    for state in reversed(states[:-1]):
        assert pdos.undo()
        assert pdos.now == state
    assert not pdos.undo()
    assert pdos.changed() == {}
    for state in states[1:]:
        assert pdos.redo()
        assert pdos.now == state
    assert not pdos.redo()


def test_entries_that_are_added_at_once_are_one_step() -> None:
    pdos = EditedPdos(held())
    pdos.insert(TPDO1, 1, SPEED, STATUS)
    assert pdos.now[TPDO1].mapping == (held()[TPDO1].mapping[0], SPEED, STATUS, *held()[TPDO1].mapping[1:])
    assert pdos.undo()
    assert not pdos.changed()


def test_what_is_edited_stays_when_the_node_is_read_again() -> None:
    pdos = EditedPdos(held())
    pdos.insert(TPDO1, 1, SPEED)
    now = held() | {RPDO1: PdoConfig(PdoCommunicationParameter(CobId(0x205)), ())}
    pdos.read_again(now)
    assert pdos.now == {TPDO1: PdoConfig(held()[TPDO1].communication, (STATUS, SPEED)), RPDO1: now[RPDO1]}
    assert list(pdos.changed()) == [TPDO1]


def test_what_is_edited_can_be_undone_if_nothing_was_applied() -> None:
    pdos = EditedPdos(held())
    pdos.insert(TPDO1, 1, SPEED)
    assert pdos.read_again(held()) == ""
    assert pdos.undo()
    assert pdos.changed() == {}


def test_what_another_changed_beside_what_is_edited_is_taken() -> None:
    pdos = EditedPdos(held())
    pdos.insert(TPDO1, 1, SPEED)
    pdos.put(TPDO1, PARAMETERS[3].set(pdos.now[TPDO1], "100"))
    pdos.switch(RPDO1)
    theirs = PdoConfig(PdoCommunicationParameter(CobId(0x1B1), 1, 0, 50), (STATUS,))
    said = pdos.read_again({TPDO1: theirs, RPDO1: theirs})
    assert said == "TPDO1: event timer changed on the node, too; yours stays"
    assert pdos.now == {
        TPDO1: PdoConfig(PdoCommunicationParameter(CobId(0x1B1), 1, 0, 100), (STATUS, SPEED)),
        RPDO1: PdoConfig(PdoCommunicationParameter(CobId(0x1B1, valid=False), 1, 0, 50), (STATUS,)),
    }
    assert pdos.held == {TPDO1: theirs, RPDO1: theirs}


@pytest.mark.parametrize("edits", [False, True])
def test_a_pdo_that_is_missing_later_stands_as_it_was(edits: bool) -> None:
    pdos = EditedPdos(held())
    if edits:
        pdos.switch(RPDO1)
    before = dict(pdos.now)
    assert pdos.read_again({TPDO1: held()[TPDO1]}) == "RPDO1 no longer exists; its old values are shown"
    assert (pdos.now, pdos.held) == (before, held())


@pytest.mark.parametrize(
    ("number", "text", "value"),
    [
        (0, "0x201", 0x201),
        (1, "254", 254),
        (1, "0xFE", 254),
        (2, "1.5", 15),
        (2, "1.5 ms", 15),
        (3, "100", 100),
        (3, "100ms", 100),
        (4, "240", 240),
    ],
)
def test_parameters_are_read_in_their_units(number: int, text: str, value: int) -> None:
    communication = PARAMETERS[number].set(held()[TPDO1], text).communication
    fields = (
        communication.cob_id.can_id, communication.transmission_type, communication.inhibit_time,
        communication.event_timer, communication.sync_start_value,
    )  # fmt: skip
    assert fields[number] == value


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0, "201"),
        (0, ""),
        (1, "256"),
        (1, "-1"),
        (1, "x"),
        (2, "0.05"),
        (2, "6554"),
        (3, "1.5"),
        (3, "1 s"),
        (3, "100 x"),
        (3, "ms"),
        (1, "0x"),
        (1, "1.5"),
        (3, "nan"),
        (4, "241"),
    ],
)  # fmt: skip
def test_what_is_no_value_is_refused(number: int, text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        PARAMETERS[number].set(held()[TPDO1], text)


def gen4() -> ObjectList:
    ((dictionary, profile),) = offline_dictionaries(Options(sim=("gen4",)))
    return ObjectList(dictionary, profile, ObjectScalings())


@pytest.mark.parametrize(
    ("text", "first"),
    [("606c", "606C:00"), ("0x6041", "6041:00"), ("6c01:1", "6C01:01"), ("velocity act", "606C:00")],
)
def test_the_best_fit_stands_first(text: str, first: str) -> None:
    offers = gen4().offers(text, tpdo=True, bits_left=64)
    assert (offers[0].listed.entry.object, offers[0].reason) == (first, "")


def test_what_does_not_fit_stands_last_with_its_reason() -> None:
    objects = gen4()
    for tpdo in (True, False):
        offers = objects.offers("", tpdo=tpdo, bits_left=8)
        reasons = [bool(offer.reason) for offer in offers]
        assert reasons == sorted(reasons)
        assert {offer.reason for offer in offers if offer.reason} >= {"too long", "not mappable"}
        assert all((offer.listed.entry.bits or 1) <= 8 for offer in offers if not offer.reason)
    assert "TPDO only" in {offer.reason for offer in objects.offers("606c", tpdo=False, bits_left=64)}


@pytest.mark.parametrize(
    ("typed", "can_id", "extended"),
    [("0x182", 0x182, False), ("0x82", 0x82, False), ("0x00000182", 0x182, True), ("0x18000182", 0x18000182, True),
     ("0x800", 0x800, True)],
)  # fmt: skip
@pytest.mark.parametrize("was", [CobId(0x181), CobId(0x18000181, extended=True)])
def test_a_can_id_has_29_bits_if_it_is_written_so(was: CobId, typed: str, can_id: int, *, extended: bool) -> None:
    config = PdoConfig(PdoCommunicationParameter(was, 255, 0, 0), (STATUS,))
    cob_id = PARAMETERS[0].set(config, typed).communication.cob_id
    assert (cob_id.can_id, cob_id.extended) == (can_id, extended)
    assert PARAMETERS[0].set(config, str(was)) == config
