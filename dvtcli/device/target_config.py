"""The requested configuration of a node, and its comparison with the node."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.domain.pdo import MAPPING, PARAMETERS, Pdo, PdoConfig
from dvtcli.domain.plan import EVENT_TIMER, INHIBIT_TIME, SYNC_START, TRANSMISSION_TYPE
from dvtcli.domain.profile import ObjectAddress
from dvtcli.domain.text import value_text

if TYPE_CHECKING:
    from dvtcli.device.node_parts import ReadableNode


def differences(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> list[str]:
    """Every parameter of *pdo* that differs between *held* and *wanted*, in words.

    A part missing from *wanted* (a file may list half a PDO) and unreadable parameters are not compared.
    """
    return [
        *(_in_communication(pdo, wanted, held) if wanted.has_cob_id else ()),
        *(_in_mapping(pdo, wanted, held) if wanted.has_mapping else ()),
    ]


def _in_communication(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_cob_id:
        yield f"its COB-ID 0x{pdo.communication_index:04X}:01 cannot be read"
        return
    is_now, should = held.communication, wanted.communication
    rows = (
        (1, "COB-ID", f"0x{is_now.cob_id.raw:08X}", f"0x{should.cob_id.raw:08X}"),
        (TRANSMISSION_TYPE, "transmission type", is_now.transmission_type, should.transmission_type),
        (INHIBIT_TIME, "inhibit time", is_now.inhibit_time, should.inhibit_time),
        (EVENT_TIMER, "event timer", is_now.event_timer, should.event_timer),
        (SYNC_START, "SYNC start value", is_now.sync_start_value, should.sync_start_value),
    )
    for sub_index, name, value, target in rows:
        place = (pdo.communication_index, sub_index)
        if place in wanted.unread:
            continue
        if place in held.unread:
            yield f"{name} 0x{place[0]:04X}:{sub_index:02X} cannot be read"
        elif value != target:
            yield f"{name} is {value}, expected {target}"


def _in_mapping(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    if not held.has_mapping:
        yield f"its mapping 0x{pdo.mapping_index:04X}:00 cannot be read"
        return
    if held.mpdo != wanted.mpdo or held.multiplexed != wanted.multiplexed:
        yield from _as_multiplexed(pdo, wanted, held)
    elif held.mapping != wanted.mapping:
        texts = [" ".join(map(str, config.mapping)) or "nothing" for config in (held, wanted)]
        yield f"0x{pdo.mapping_index:04X} is {texts[0]}, expected {texts[1]}"
    if held.count != wanted.count and (held.held_count, wanted.held_count) != (None, None):
        yield f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}"


def _as_multiplexed(pdo: Pdo, wanted: PdoConfig, held: PdoConfig) -> Iterator[str]:
    """The differences of an MPDO, or of a PDO that should be an MPDO."""
    if held.count != wanted.count:
        yield f"0x{pdo.mapping_index:04X}:00 (count) is {held.count}, expected {wanted.count}"
    else:
        texts = [" ".join(map(str, config.multiplexed)) or "nothing" for config in (held, wanted)]
        yield f"0x{pdo.mapping_index:04X}:01 is {texts[0]}, expected {texts[1]}"


#: What differs: the PDO's label or the object, and the difference in words.
Difference = tuple[str, str]
#: The value of the object at a place, in words.
ValueFormatter = Callable[[int, int, bytes], str]


@dataclass(frozen=True, slots=True)
class TargetConfig:
    """The requested PDOs and single objects of a node.

    *requested* are the parameters of a PDO (`domain.pdo.PARAMETERS`) if not all; the others keep their present values
    and do not differ.
    """

    pdos: dict[Pdo, PdoConfig] = field(default_factory=dict)
    values: dict[ObjectAddress, bytes] = field(default_factory=dict)
    requested: Mapping[Pdo, frozenset[str]] = field(default_factory=dict)
    #: differences that nobody would write
    unwritten: tuple[Difference, ...] = ()
    #: equal objects that nobody would write
    also_equal: tuple[str, ...] = ()
    #: objects that were, or would be, written and cannot be read back, each as `2050:00`
    unreadable: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.pdos or self.values or self.unwritten or self.also_equal)

    def only(self, pdos: Collection[Pdo]) -> TargetConfig:
        """The part about *pdos*."""
        chosen = {pdo: config for pdo, config in self.pdos.items() if pdo in pdos}
        unwritten = tuple(row for row in self.unwritten if _pdo_of(row[0]) in pdos)
        return TargetConfig(chosen, requested=self.requested, unwritten=unwritten)

    @property
    def objects(self) -> int:
        """The number of compared single objects."""
        return len(self.values) + len(self.also_equal) + sum(":" in label for label, _ in self.unwritten)

    @property
    def parameters(self) -> int:
        """The number of compared parameters: five per PDO's communication, its entries, and the single objects."""
        return sum(self._said_of(pdo, config) for pdo, config in self.pdos.items()) + self.objects

    @property
    def unsaid(self) -> int:
        """The number of parameters of these PDOs without a request."""
        return sum(5 + len(config.mapping) - self._said_of(pdo, config) for pdo, config in self.pdos.items())

    def _said_of(self, pdo: Pdo, config: PdoConfig) -> int:
        requested = self.requested.get(pdo, frozenset(PARAMETERS))
        communication = len(requested - {MAPPING}) if config.has_cob_id else 0
        return communication + (len(config.mapping) if MAPPING in requested and config.has_mapping else 0)


def _pdo_of(label: str) -> Pdo | None:
    """The PDO with the parameter object *label*."""
    index, colon, _ = label.partition(":")
    return Pdo.at(int(index, 16)) if colon else None


def session_target(node: ReadableNode) -> TargetConfig:
    """The last values set by this session on *node*, per PDO and object."""
    return TargetConfig(dict(node.wanted), dict(node.wanted_values), unreadable=unreadable_of(node))


def unreadable_of(node: ReadableNode) -> tuple[str, ...]:
    """The objects written by this session that cannot be read back from *node*, each as `2050:00`."""
    return tuple(f"{index:04X}:{sub_index:02X}" for index, sub_index in node.unreadable_values)


def value_in_hex(_index: int, _sub_index: int, data: bytes) -> str:
    """As `value_text`, for any object."""
    return value_text(data)


def config_differences(
    node: ReadableNode, target: TargetConfig, format_value: ValueFormatter = value_in_hex
) -> tuple[Difference, ...]:
    """Every difference between *target* and *node* now, with values formatted by *format_value*.

    Raises NoAnswer after repeated restarts of the node.
    """
    return node.observed(lambda: tuple(_config_differences(node, target, format_value)))


def _config_differences(node: ReadableNode, target: TargetConfig, format_value: ValueFormatter) -> Iterator[Difference]:
    for pdo, wanted in target.pdos.items():
        yield from ((pdo.label, text) for text in differences(pdo, wanted, node.pdo(pdo)))
    yield from value_differences(node, target.values, format_value)
    yield from target.unwritten


def value_differences(
    node: ReadableNode, values: Mapping[ObjectAddress, bytes], format_value: ValueFormatter = value_in_hex
) -> Iterator[Difference]:
    """Every single object that differs from *values*."""
    for (index, sub_index), value in values.items():
        held = node.upload(index, sub_index)
        if held != value:
            texts = (format_value(index, sub_index, data) for data in (held, value))
            yield f"{index:04X}:{sub_index:02X}", "is {}, expected {}".format(*texts)
