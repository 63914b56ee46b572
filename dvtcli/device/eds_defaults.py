"""The defaults that an EDS tells of a node's PDOs, and where a node differs from them. Reads no device."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dvtcli.device.described_node import Defaults
from dvtcli.device.quirks.standard_channel import in_standard_order
from dvtcli.device.wish import value_text
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.domain.ports import SdoTransport
from dvtcli.domain.profile import DeviceProfile
from dvtcli.errors import SdoAborted


def differing_from_defaults(
    dictionary: ObjectDictionary, profile: DeviceProfile, node_id: int, held: Mapping[Pdo, PdoConfig]
) -> tuple[int, list[str]]:
    """How many of the *held* PDOs have a default in the file, and every parameter that is not its default."""
    channel = in_standard_order(Defaults(dictionary, node_id), profile)
    compared, differences = 0, []
    for pdo, config in held.items():
        found = list(_compared(channel, pdo, config))
        compared += bool(found)
        differences += [text for text in found if text]
    return compared, differences


def values_unlike_defaults(
    dictionary: ObjectDictionary, node_id: int, held: Mapping[tuple[int, int], bytes]
) -> tuple[int, list[str]]:
    """How many of the single objects in *held* have a default in the file, and every one that is not its default."""
    channel = Defaults(dictionary, node_id)
    compared, differences = 0, []
    for (index, sub_index), data in held.items():
        try:
            default = channel.upload(index, sub_index)
        except SdoAborted:
            continue  # the file tells no default: nothing to compare with
        compared += 1
        if data != default:
            texts = f"is {value_text(data)}, its default is {value_text(default)}"
            differences.append(f"{index:04X}:{sub_index:02X}: {texts}")
    return compared, differences


def _compared(defaults: SdoTransport, pdo: Pdo, config: PdoConfig) -> Iterator[str]:
    """For every parameter whose default is known what differs, in words; empty where nothing does."""
    for index, sub_index, value in _values(pdo, config):
        try:
            data = defaults.upload(index, sub_index)
        except SdoAborted:
            continue  # the file tells no default: nothing to compare with
        width = 2 * len(data)
        same = int.from_bytes(data, "little") == value
        place = f"{pdo.label}: 0x{index:04X}:{sub_index:02X}"
        yield "" if same else f"{place} is 0x{value:0{width}X}, its default is 0x{data[::-1].hex().upper()}"


def _values(pdo: Pdo, config: PdoConfig) -> Iterator[tuple[int, int, int]]:
    held = config.communication
    rows = (
        (1, held.cob_id.raw),
        (TRANSMISSION_TYPE, held.transmission_type),
        (INHIBIT_TIME, held.inhibit_time),
        (EVENT_TIMER, held.event_timer),
        (SYNC_START, held.sync_start_value),
    )
    yield from ((pdo.communication_index, sub_index, value) for sub_index, value in rows if value is not None)
    yield pdo.mapping_index, 0, config.count
    for number, entry in enumerate(config.mapping, 1):
        yield pdo.mapping_index, number, entry.raw
