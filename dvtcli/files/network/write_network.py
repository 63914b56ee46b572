"""Write a network file that reads back equal, in a stable order, with remarks behind their words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.network.network_config import (
    Endpoint,
    LinkConfig,
    MasterRole,
    NetworkConfig,
    NodeConfig,
    PartialPdoConfig,
    PinConfig,
)
from dvtcli.domain.pdo import Direction
from dvtcli.files.network.network_keys import OF, STORE_WORDS, Where

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*|[0-9A-F]{4}:[0-9A-F]{2}(/[0-9]{1,2})?|dummy/[0-9]{1,2}")
_PLAIN_LINK = re.compile(r"[A-Za-z_][A-Za-z0-9_]*:[rt]pdo[0-9]+")
_NUMBER = re.compile(r"-?(0|[1-9][0-9]{0,18}|0x[0-9A-F]{1,16})")
#: words that are no text in YAML 1.1 or 1.2
_WORDS = {"true", "false", "yes", "no", "on", "off", "null", "y", "n", "auto"}
_REMARK_AT = 40
Remarks = Mapping[str, str]
#: comments by node-ID and word
NodeRemarks = Mapping[tuple[int, str], str]


def write_network(config: NetworkConfig, title: str = "", remarks: NodeRemarks | None = None) -> str:
    """Return the text of *config*; *title* is the first line, *remarks* are comments behind words, e.g. names."""
    names = {node.node_id: node.name for node in config.nodes}
    lines = [f"# {_one_line(title)}"] if title else []
    if config.multiplier is not None:
        lines += ["options:", f"  heartbeat_multiplier: {config.multiplier:.12g}"]
    lines += [*_master(config.master), "nodes:"]
    for node in config.nodes:
        here = {word: text for (node_id, word), text in (remarks or {}).items() if node_id == node.node_id}
        lines += [f"  {_word(node.name)}:", *(f"    {line}" for line in _node(node, names, here))]
    if config.links:
        lines += ["links:", *(line for link in config.links for line in _link(link, names))]
    return "\n".join([*lines, ""])


def _one_line(text: str) -> str:
    return "".join(char if char.isprintable() else "?" for char in text)


def _word(text: str) -> str:
    """Return a text as YAML, in quotes if ambiguous."""
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else _quoted(text)


def _quoted(text: str) -> str:
    return f'"{"".join(map(_escaped, text))}"'


def _escaped(char: str) -> str:
    if char in '"\\':
        return f"\\{char}"
    return char if char.isprintable() else f"\\U{ord(char):08X}"


def _remarked(line: str, remark: str) -> str:
    return f"{line:<{_REMARK_AT}}  # {_one_line(remark)}" if remark else line


def _master(master: MasterRole | None) -> Iterator[str]:
    if master is None:
        return
    values = {
        "node_id": master.node_id,
        "sync_period": master.sync_period_us,
        "heartbeat_producer": master.heartbeat_producer_ms,
        "baudrate": None if master.bit_rate is None else master.bit_rate // 1000,
    }
    lines = [f"  {key}: {value}" for key, value in values.items() if value is not None]
    yield "master:"
    yield from lines or ["  node_id: 255"]


def _node(node: NodeConfig, names: Mapping[int, str], remarks: Remarks) -> Iterator[str]:
    yield f"node_id: {node.node_id}"
    yield from _device(node)
    yield from _objects(node)
    if node.watches:
        yield "heartbeat_consumer:"
        for watch in node.watches:
            name = names.get(watch.producer)
            yield f"  {watch.producer if name is None else _word(name)}: {watch.time_ms}"
    for direction in (Direction.TPDO, Direction.RPDO):
        configs = [config for config in node.pdos if config.pdo.direction is direction]
        if configs:
            yield f"{direction}:"
            yield from (f"  {line}" for config in configs for line in _pdo(config, remarks))
    if node.values:
        yield "sdo:"
        for value in node.values:
            line = f"  - {{object: {_word(value.object.text)}, value: {_value(value.value.text)}}}"
            yield _remarked(line, remarks.get(value.object.text, ""))
    yield from _pins(node.pins)
    if node.physical:
        yield "physical:"
        yield from (f"  {_word(name)}: {text}" for name, text in node.physical)
    yield from _ways(node)


def _device(node: NodeConfig) -> Iterator[str]:
    """Write the keys that say which device the node is."""
    if node.dcf is not None:
        yield f"dcf: {_quoted(node.dcf.text)}"
    if node.modules is not None:
        yield f"modules: [{', '.join(map(str, node.modules))}]"
    if node.profile is not None:
        yield f"profile: {_word(node.profile)}"
    yield from _identity(node)


def _identity(node: NodeConfig) -> Iterator[str]:
    said = {name: getattr(node.identity, name) for name in OF[Where.IDENTITY]}
    numbers = [f"{name}: 0x{value:08X}" for name, value in said.items() if value is not None]
    if numbers:
        yield f"identity: {{{', '.join(numbers)}}}"


def _objects(node: NodeConfig) -> Iterator[str]:
    """Write a node's keys for objects; those of 0x1029 share a key."""
    behaviour = [f"{config.sub_index}: {config.data[0]}" for config in node.objects if config.key == "error_behavior"]
    for config in node.objects:
        if config.key != "error_behavior":
            number = int.from_bytes(config.data, "little")
            hexadecimal = len(config.data) == 4 and not OF[Where.NODE][config.key].unit
            yield f"{config.key}: {f'0x{number:X}' if hexadecimal else number}"
    if behaviour:
        yield f"error_behavior: {{{', '.join(behaviour)}}}"


def _pdo(config: PartialPdoConfig, remarks: Remarks) -> Iterator[str]:
    tpdo, inhibit = config.pdo.is_tpdo, config.inhibit_time
    said = {
        "enabled": config.enabled,
        "cob_id": _cob_id(config),
        "rtr_allowed": None if isinstance(config.cob_id, int) and config.rtr_allowed is False else config.rtr_allowed,
        "transmission": config.transmission_type,
        "inhibit_ms": None if inhibit is None else f"{inhibit / 10:.1f}",
        "event_timer" if tpdo else "event_deadline": config.event_timer,
        "sync_start": config.sync_start_value,
    }
    lines = [f"  {key}: {_plain(value)}" for key, value in said.items() if value is not None]
    yield f"{config.pdo.number}:{'' if lines or config.mapping is not None else ' {}'}"
    yield from lines
    if config.mapping is not None:
        yield "  mapping:" if config.mapping else "  mapping: []"
    for word in config.mapping or ():
        yield _remarked(f"    - {_word(word.text)}", remarks.get(word.text, ""))


def _cob_id(config: PartialPdoConfig) -> str | None:
    """The COB-ID with bits 29 and 30; bit 31 is `enabled`."""
    if not isinstance(config.cob_id, int):
        return config.cob_id
    raw = CobId(config.cob_id, rtr_allowed=config.rtr_allowed is not False, extended=config.extended).raw
    return f"0x{raw:03X}"


def _plain(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _value(text: str) -> str:
    return text if _NUMBER.fullmatch(text) else _quoted(text)


def _pins(pins: Iterable[PinConfig]) -> Iterator[str]:
    groups: dict[str, list[PinConfig]] = {}
    for pin in pins:
        groups.setdefault(pin.group, []).append(pin)
    if groups:
        yield "vpdo:"
    for group, tied in groups.items():
        words = (f"{pin.pin}: {'none' if pin.object is None else _word(pin.object.text)}" for pin in tied)
        yield f"  {_word(group)}: {{{', '.join(words)}}}"


def _ways(node: NodeConfig) -> Iterator[str]:
    if node.store is not None:
        yield f"store: {node.store if node.store in STORE_WORDS else _plain(node.store)}"
    for name in ("prune", "stamp"):
        value = getattr(node, name)
        if value is not None:
            yield f"{name}: {_plain(value)}"


def _link(link: LinkConfig, names: Mapping[int, str]) -> Iterator[str]:
    yield f"  - from: {_endpoint(link.producer, names)}"
    yield f"    to: [{', '.join(_endpoint(consumer, names) for consumer in link.consumers)}]"
    if link.heartbeat is not None:
        yield f"    heartbeat: {_plain(link.heartbeat)}"


def _endpoint(end: Endpoint, names: Mapping[int, str]) -> str:
    text = f"{names[end.node_id]}:{end.pdo}"
    return text if _PLAIN_LINK.fullmatch(text) else _quoted(text)
