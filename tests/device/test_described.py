"""What a file says of a device, beside what the device holds: values, defaults, and where the two differ."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.cli.view.typed_hints import typed
from dvtcli.device.described_node import Defaults, FileValues
from dvtcli.device.known_pdos import hint_for_missing, no_pdo
from dvtcli.device.store.prove_restore import AgainstDefaults, differing_from_defaults, values_unlike_defaults
from dvtcli.device.target_config import TargetConfig, config_differences
from dvtcli.domain.abort import Abort
from dvtcli.domain.datatypes import DATA_TYPES
from dvtcli.domain.object_dictionary import Access, ObjectDictionary, OdEntry, OdObject
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import GENERIC
from dvtcli.domain.text import value_text
from dvtcli.errors import SdoAborted
from tests.device.test_request import node

TPDO1, TPDO2, RPDO1 = Pdo.parse("tpdo1"), Pdo.parse("tpdo2"), Pdo.parse("rpdo1")


def entries(*found: OdEntry) -> ObjectDictionary:
    objects: dict[int, dict[int, OdEntry]] = {}
    for one in found:
        objects.setdefault(one.index, {})[one.sub_index] = one
    return ObjectDictionary({index: OdObject(index, "", 7, held) for index, held in objects.items()})


UNSIGNED16 = next(kind for kind in DATA_TYPES.values() if kind.name == "UNSIGNED16")
DESCRIBED = entries(
    OdEntry(0x1000, 0, "", UNSIGNED16, Access.RO, None, b"\1\0", value=b"\2\0"),
    OdEntry(0x1017, 0, "", UNSIGNED16, Access.RW, None, b"\5\0"),
    OdEntry(0x2000, 0, "", UNSIGNED16),
    OdEntry(0x2001, 0, ""),
)


def abort_of(channel: FileValues, index: int, sub_index: int = 0) -> int:
    with pytest.raises(SdoAborted) as caught:
        channel.upload(index, sub_index)
    return caught.value.code


def test_a_file_holds_its_values_then_its_defaults_then_zeros() -> None:
    held = FileValues(DESCRIBED, 5)
    assert [held.upload(index, 0) for index in (0x1000, 0x1017, 0x2000, 0x2001)] == [b"\2\0", b"\5\0", b"\0\0", b"\0"]
    assert abort_of(held, 0x1017, 1) == Abort.NO_SUB_INDEX
    assert abort_of(held, 0x1018) == Abort.NO_OBJECT
    with pytest.raises(SdoAborted) as caught:
        held.download(0x1017, 0, b"\0\0")
    assert caught.value.code == Abort.READ_ONLY


def test_defaults_are_what_the_file_tells_and_nothing_else() -> None:
    held = Defaults(DESCRIBED, 5)
    assert [held.upload(index, 0) for index in (0x1000, 0x1017)] == [b"\1\0", b"\5\0"]
    assert abort_of(held, 0x2000) == Abort.NO_SUB_INDEX


def test_single_objects_that_are_not_their_default_are_named() -> None:
    held = {(0x1000, 0): b"\2\0", (0x1017, 0): b"\5\0", (0x2000, 0): b"\1\0", (0x2005, 1): b""}
    found = values_unlike_defaults(DESCRIBED, 5, held)
    assert (found.compared, found.differences) == (2, ("1000:00: is 0x0002, its default is 0x0001",))
    assert found.not_compared == ("0x2000:00", "0x2005:01")


def altered(config: PdoConfig, **parameters: int) -> PdoConfig:
    return config.with_parameters(**parameters)


def test_every_parameter_of_a_pdo_that_is_not_its_default_is_named() -> None:
    one, _ = node()
    assert one.dictionary is not None
    held = {pdo: one.pdo(pdo) for pdo in (TPDO1, TPDO2, RPDO1)}
    assert differing_from_defaults(one.dictionary, GENERIC, 1, held) == AgainstDefaults(3, (), ())
    held[TPDO1] = altered(held[TPDO1], transmission_type=1, inhibit_time=0x123, event_timer=7)
    held[RPDO1] = replace(held[RPDO1], mapping=(held[TPDO2].mapping[0],))
    found = differing_from_defaults(one.dictionary, GENERIC, 1, held)
    assert (found.compared, found.not_compared) == (3, ())
    assert found.differences == (
        "TPDO1: 0x1800:02 is 0x01, its default is 0xFF",
        "TPDO1: 0x1800:03 is 0x0123, its default is 0x0000",
        "TPDO1: 0x1800:05 is 0x0007, its default is 0x0000",
        f"RPDO1: 0x1600:01 is 0x{held[TPDO2].mapping[0].raw:08X}, its default is 0x60400010",
    )


def test_a_mapping_of_another_length_is_named_by_its_count() -> None:
    one, _ = node()
    assert one.dictionary is not None
    held = replace(one.pdo(RPDO1), mapping=())
    assert differing_from_defaults(one.dictionary, GENERIC, 1, {RPDO1: held}) == AgainstDefaults(
        1, (f"RPDO1: 0x1600:00 is 0x00, its default is 0x{one.pdo(RPDO1).count:02X}",), ()
    )  # fmt: skip


def cob_id(index: int, sub_index: int, default: bytes | None) -> ObjectDictionary:
    return entries(OdEntry(index, sub_index, "", default=default))


@pytest.mark.parametrize(
    ("index", "sub_index", "default", "held", "told"),
    [
        (0x1800, 1, bytes(4), b"\0\0\0\x80", None),  # CAN-ID 0x000 is NMT: no file means that
        (0x1800, 1, b"\x81\1\0\0", b"\x81\1\0\0", b"\x81\1\0\0"),
        (0x1800, 2, bytes(4), bytes(4), bytes(4)),
        (0x1A00, 1, bytes(4), bytes(4), bytes(4)),
        (0x1800, 1, bytes(2), bytes(2), bytes(2)),
        (0x2000, 1, bytes(4), bytes(4), bytes(4)),
    ],
)
def test_a_pdo_of_which_a_file_tells_no_cob_id_is_off(
    index: int, sub_index: int, default: bytes, held: bytes, told: bytes | None
) -> None:
    described = cob_id(index, sub_index, default)
    assert FileValues(described, 5).upload(index, sub_index) == held
    if told is None:
        assert abort_of(Defaults(described, 5), index, sub_index) == Abort.NO_SUB_INDEX
    else:
        assert Defaults(described, 5).upload(index, sub_index) == told


def test_where_the_file_tells_no_default_nothing_was_compared() -> None:
    one, _ = node()
    assert differing_from_defaults(DESCRIBED, GENERIC, 1, {TPDO1: one.pdo(TPDO1)}) == AgainstDefaults(0, (), ("TPDO1",))


def test_a_parameter_of_which_the_file_or_the_node_tells_nothing_is_named() -> None:
    one, _ = node()
    described = entries(
        *(OdEntry(0x1800, sub, "", default=data) for sub, data in ((1, bytes(4)), (2, b"\xff"), (5, bytes(2))))
    )
    held = replace(one.pdo(TPDO1), mapping=())
    held = held.with_parameters(event_timer=None, inhibit_time=None)
    found = differing_from_defaults(described, GENERIC, 1, {TPDO1: held})
    assert (found.compared, found.differences) == (1, ())
    assert found.not_compared == ("0x1800:01", "0x1800:05", "0x1800:06", "0x1A00:00"), "0x000 is no CAN-ID of a PDO"


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\1", "0x01"),
        (b"\1\2", "0x0201"),
        (b"\1\2\3\4", "0x04030201"),
        (b"\1\2\3\4\5\6\7\x08", "0x0807060504030201"),
        (b"\1\2\3", "01 02 03"),
        (b"\1\2\3\4\5", "01 02 03 04 05"),
        (b"\xab" * 9, "AB AB AB AB AB AB AB AB AB"),
        (b"", "empty"),
    ],
)
def test_a_value_is_a_number_where_it_has_a_number_s_length(data: bytes, text: str) -> None:
    assert value_text(data) == text


def test_a_wish_is_compared_pdo_by_pdo_and_object_by_object() -> None:
    one, channel = node()
    first, second = one.pdo(TPDO1), one.pdo(TPDO2)
    target = TargetConfig(
        {TPDO1: altered(first, event_timer=7), TPDO2: replace(second, mapping=())}, {(0x1017, 0): b"\1\0"}
    )
    held = channel.upload(0x1017, 0)
    assert config_differences(one, target) == (
        ("TPDO1", f"event timer is {first.communication.event_timer}, expected 7"),
        ("TPDO2", f"0x1A01 is {' '.join(map(str, second.mapping))}, expected nothing"),
        ("1017:00", f"is {value_text(held)}, expected 0x0001"),
    )
    assert config_differences(one, target.only([TPDO1])) == (
        ("TPDO1", f"event timer is {first.communication.event_timer}, expected 7"),
    )
    assert target.parameters == 5 + len(first.mapping) + 5 + 1
    assert not TargetConfig()
    assert TargetConfig({}, {(0x1017, 0): b""})


def test_a_pdo_that_a_node_has_not_is_named_beside_those_it_has() -> None:
    aborted = SdoAborted(0x1808, 1, Abort.NO_OBJECT, node=5)
    error = no_pdo(5, Pdo.parse("tpdo9"), [TPDO1, TPDO2, RPDO1], aborted)
    assert (error.slug, error.exit_code) == ("sdo_abort", 1), "it was typed well: this device lacks it"
    assert error.text == "node 5 has no TPDO9: it has tpdo1…tpdo2"
    assert (typed(error.hint), error.exit_code, error.abort) == ("`pdo --all` lists its PDOs", 1, aborted.abort)
    again = SdoAborted(0x1808, 1, Abort.NO_OBJECT, node=5)
    assert "it has no TPDOs" in str(no_pdo(5, Pdo.parse("tpdo9"), [RPDO1], again))
    assert no_pdo(5, TPDO2, [TPDO1, TPDO2], aborted) is aborted, "one that it answered for: something else is wrong"


def test_what_to_try_where_an_object_is_missing() -> None:
    described = entries(*(OdEntry(0x1A00, sub_index, "") for sub_index in (0, 0x10)))
    no_object, no_sub_index = (SdoAborted(0x1A00, 10, code) for code in (Abort.NO_OBJECT, Abort.NO_SUB_INDEX))
    assert typed(hint_for_missing(no_object, None)) == "--eds FILE names its objects"
    assert typed(hint_for_missing(no_object, described)) == "`objects TEXT` searches the dictionary"
    assert hint_for_missing(no_sub_index, None) is None
    meant_decimal = SdoAborted(0x1A00, 0x16, Abort.NO_SUB_INDEX)
    assert hint_for_missing(meant_decimal, described) == "sub-indices are hexadecimal: decimal 16 is 1A00:10"
    assert hint_for_missing(SdoAborted(0x1A00, 10, Abort.GENERAL), described) is None
