"""The tables of a page: columns, and rows with sort keys."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from dvtcli.domain.network.picture import NetworkPicture, PictureFinding, PictureFrame
from dvtcli.domain.pdo import PdoConfig
from dvtcli.files.picture.picture_words import (
    byte_count,
    cob_id,
    ends_text,
    ms,
    node_text,
    object_text,
    percent,
    timing,
)

_SEVERITIES = ("error", "warning", "note")
#: minimum length of a bar
_LEAST_BAR = 0.02
#: length of a node's name without a second line
_SHORT_NAME = 20
#: sorts after every number
_LAST = float("inf")


@dataclass(frozen=True, slots=True)
class TableCell:
    """A cell: text, sort key (None: the text), *style*, link *target*, *bar* of 0…1."""

    text: str
    key: float | None = None
    style: str = ""
    target: str = ""
    bar: float | None = None


@dataclass(frozen=True, slots=True)
class TableColumn:
    """The head of a column; numbers are aligned right."""

    title: str
    is_number: bool = False


@dataclass(frozen=True, slots=True)
class PageTable:
    """A table with sortable columns."""

    name: str
    caption: str
    columns: tuple[TableColumn, ...]
    rows: tuple[tuple[TableCell, ...], ...]


def findings_table(picture: NetworkPicture) -> PageTable:
    """Return the findings of `check`."""
    has_lines = any(finding.line for finding in picture.findings)
    columns = ("Severity", "Node", "What", "Rule", *(("Line",) if has_lines else ()))
    rows = (
        (
            TableCell(finding.severity, _SEVERITIES.index(finding.severity), f"severity {finding.severity}"),
            _node(picture, finding.node),
            TableCell(finding.text),
            TableCell(finding.rule, style="code"),
            *((_line(finding),) if has_lines else ()),
        )
        for finding in sorted(picture.findings, key=lambda found: _SEVERITIES.index(found.severity))
    )
    return _table("findings", "Findings of the rules", columns, rows, "Line")


def _line(finding: PictureFinding) -> TableCell:
    return TableCell(
        "-" if finding.line is None else str(finding.line), _LAST if finding.line is None else finding.line
    )


def differences_table(picture: NetworkPicture) -> PageTable:
    """Return the differences between nodes and a file."""
    columns = ("Node", "PDO or object", "What", "On the node", f"In {picture.compared}")
    rows = (
        (
            _node(picture, difference.node),
            TableCell(difference.what),
            TableCell(difference.key, style="code"),
            TableCell(difference.was),
            TableCell(difference.will),
        )
        for difference in picture.differences or ()
    )
    return _table("differences", f"Differences to {picture.compared}", columns, rows)


def nodes_table(picture: NetworkPicture) -> PageTable:
    """Return every node with its device, number of PDOs, and services."""
    columns = ("Node-ID", "Name", "Device", "TPDOs", "RPDOs", "Heartbeat", "Watches", "SYNC", "EMCY")
    rows = []
    for node in picture.nodes:
        facts = dict(node.facts)
        sends, hears = (len(node.enabled(is_tpdo=is_tpdo)) for is_tpdo in (True, False))
        device = node.title if node.is_told else "only the values of the file are known"
        rows.append((
            TableCell(str(node.node_id), node.node_id), TableCell(node.name or "-", style=_name_style(node.name)),
            TableCell(device or "-"), TableCell(str(sends), sends), TableCell(str(hears), hears),
            *(TableCell(facts.get(key, "-")) for key in ("heartbeat", "watches", "SYNC", "EMCY")),
        ))  # fmt: skip
    return _table("nodes", "Nodes", columns, rows, "Node-ID", "TPDOs", "RPDOs")


def pdos_table(picture: NetworkPicture) -> PageTable:
    """Return every PDO, including disabled PDOs."""
    columns = ("Node", "PDO", "State", "COB-ID", "Length", "Timing", "Maps", "Linked with")
    rows = []
    for node, pdo in picture.pdos:
        target = f"{pdo.end.pdo}-{node.node_id}" if pdo.config.enabled else ""
        maps = ", ".join("skipped" if field.is_dummy else object_text(field) for field in pdo.fields)
        key = pdo.end.pdo.number + 1000 * pdo.is_tpdo
        rows.append((
            _node(picture, node.node_id), TableCell(pdo.end.pdo.label, key, target=target),
            _state(pdo.config, is_told=node.is_told),
            _cob_id(pdo.identifier) if pdo.config.has_cob_id else TableCell("not told", _LAST),
            TableCell(byte_count(pdo), pdo.config.bits), TableCell(timing(pdo) or "-"), TableCell(maps or "-"),
            TableCell(ends_text(pdo.partners) or "-"),
        ))  # fmt: skip
    return _table("pdos", "PDOs", columns, rows)


def frames_table(picture: NetworkPicture) -> PageTable:
    """Return every CAN-ID with producer, consumers and bus load."""
    received = picture.load.measured is not None
    columns = ["COB-ID", "What", "Sent by", "Received by", "Bytes", "At most", "Load", "Response", "Deadline"]
    columns += ["Heard/s", "Measured load"] if received else []
    most = max((float(frame.share) for frame in picture.frames if frame.share is not None), default=0.0)
    rows = []
    for frame in picture.frames:
        row = [
            _cob_id(frame.identifier), TableCell(frame.what or "-"), _node(picture, frame.node),
            TableCell(ends_text(frame.consumers) or "-"),
            _length(frame), _at_most(frame), *_times(frame, most),
        ]  # fmt: skip
        if received:
            row += [
                TableCell(f"{frame.measured_hz or 0:.1f}", frame.measured_hz or 0),
                TableCell(percent(frame.measured_share or 0), frame.measured_share or 0),
            ]
        rows.append(tuple(row))
    numbers = ("Bytes", "Load", "Response", "Deadline", "Heard/s", "Measured load")
    return _table("frames", "Frames on the bus", columns, rows, *numbers)


def _table(
    name: str, caption: str, titles: Iterable[str], rows: Iterable[tuple[TableCell, ...]], *numbers: str
) -> PageTable:
    columns = tuple(TableColumn(title, title in numbers) for title in titles)
    return PageTable(name, caption, columns, tuple(rows))


def _node(picture: NetworkPicture, node_id: int | None) -> TableCell:
    text = node_text(picture, node_id)
    return TableCell(text, _LAST if node_id is None else node_id, _name_style(text))


def _name_style(text: str) -> str:
    """Keep a short name on one line; break a long name if space requires."""
    return "node short" if len(text) <= _SHORT_NAME else "node"


def _cob_id(identifier: tuple[int, bool]) -> TableCell:
    can_id, extended = identifier
    return TableCell(cob_id(identifier), can_id + (1 << 11 if extended else 0), "code")


def _state(config: PdoConfig, *, is_told: bool) -> TableCell:
    if config.inconsistency and is_told:
        return TableCell("not whole", 2, "severity error")
    return TableCell("on", 0, "on") if config.enabled else TableCell("off", 1, "dim")


def _length(one: PictureFrame) -> TableCell:
    return TableCell(str(one.data_bytes) if one.what else "-", one.data_bytes)


def _at_most(one: PictureFrame) -> TableCell:
    key = _LAST if one.period_us is None else float(one.period_us)
    return TableCell(one.why or "-", key, "bad" if one.has_no_limit else "")


def _times(one: PictureFrame, most: float) -> Iterator[TableCell]:
    """Return a frame's bus load, response time and deadline."""
    if not one.is_computed:
        yield from (TableCell("-", _LAST) for _ in range(3))
        return
    share = None if one.share is None else float(one.share)
    bar = share / most if share is not None and most and share > _LEAST_BAR * most else None
    yield TableCell(percent(share), _LAST if share is None else share, "bad" if share is None else "", bar=bar)
    late = "bad" if one.is_late else ""
    yield TableCell("no bound" if one.response_us is None else ms(one.response_us), _key(one.response_us), late)
    yield TableCell(ms(one.deadline_us) + (" - late" if one.is_late else ""), _key(one.deadline_us), late)


def _key(time_us: Fraction | None) -> float:
    return _LAST if time_us is None else float(time_us)
