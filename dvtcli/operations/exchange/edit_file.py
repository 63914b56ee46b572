"""Edit the PDOs of a network file's nodes, or of a DCF or XDC, without a bus: simulated nodes hold its values."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dvtcli.domain.hint import Action, Hint, as_hint
from dvtcli.domain.network.links import CONSUMER_PERIODS, watch_time_ms
from dvtcli.domain.network.network_config import (
    Endpoint,
    HeartbeatWatch,
    LinkConfig,
    NetworkConfig,
    NodeConfig,
    PartialPdoConfig,
)
from dvtcli.domain.network.worst_case_load import streams_of, worst_case_load
from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import Severity
from dvtcli.domain.text import all_nodes, join_some, plural
from dvtcli.errors import DeviceRefused, RuleError, UsageError
from dvtcli.files.device_file import VALUE_SUFFIXES, change_values
from dvtcli.files.eds.ini import MOST_BYTES
from dvtcli.files.input_file import read_input
from dvtcli.files.network.file_log import FileLog
from dvtcli.files.network.read_network import MOST_BYTES as MOST_OF_NETWORK
from dvtcli.files.network.read_network import read_network
from dvtcli.files.network.write_network import write_network
from dvtcli.files.network.yaml_tree import Branch, count_aliases, read_tree
from dvtcli.operations.changes.change import configure
from dvtcli.operations.exchange.export_network import SUFFIXES as NETWORK_SUFFIXES
from dvtcli.operations.exchange.export_network import mapped_word
from dvtcli.operations.network.check_networks import CheckOptions, judged_file
from dvtcli.operations.network.described_network import described_network, simulation_of, words_of
from dvtcli.operations.network.network_load import USUAL_BIT_RATE
from dvtcli.operations.pdos.edit_pdos import Configs, edited_plan, judge_edited
from dvtcli.operations.plans.read_network_config import read_network_config
from dvtcli.operations.session.save_script import make_file, place_of
from dvtcli.operations.user.options import Options

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.domain.network.network_state import NetworkState
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.profile import ObjectAddress
    from dvtcli.domain.rules.finding import Finding
    from dvtcli.operations.results import NetworkFinding
    from dvtcli.operations.session.session import Session, SessionNodes
    from dvtcli.operations.user.session_user import SessionUser

_COMMENT = re.compile(r"(?:^|\s)#")
#: suffixes of the files of which `eds convert` makes a DCF
_CONVERTED = (".eds", ".xdd")


@dataclass(frozen=True, slots=True)
class Edited:
    """The PDOs of *node* as the file *held* them, and the *changed* PDOs."""

    node: Node
    held: Configs
    changed: Configs


@dataclass(frozen=True, slots=True)
class EditedLink:
    """A link made in the editor; *watch_ms* is the heartbeat consumer time written with it, None for none."""

    producer: Endpoint
    consumer: Endpoint
    watch_ms: int | None = None

    def __str__(self) -> str:
        return f"link {self.producer.node_id}:{self.producer.pdo} to {self.consumer.node_id}:{self.consumer.pdo}"


@dataclass(frozen=True, slots=True)
class Edits:
    """The changed *nodes* of a file by node-ID, and the *links* that it does not have yet."""

    nodes: Mapping[int, Edited]
    links: Sequence[EditedLink] = ()

    def __str__(self) -> str:
        pdos = [f"{node_id}:{pdo}" for node_id, node in sorted(self.nodes.items()) for pdo in node.changed]
        return join_some([*pdos, *map(str, self.links)])

    def __bool__(self) -> bool:
        """Tell whether anything is changed."""
        return bool(self.nodes or self.links)


@dataclass(frozen=True, slots=True)
class PdoFinding:
    """A finding of `check` about a PDO: *rule*, *severity*, *place* (the object, else the PDO) and *text*."""

    rule: str
    severity: Severity
    place: str
    text: str


@dataclass(frozen=True, slots=True)
class Judged:
    """The findings of the rules by node-ID and PDO, and the *status* of the file in one line.

    *listed* are all findings about a network file: also of its nodes and its links.
    """

    findings: Mapping[int, Mapping[Pdo, Sequence[PdoFinding | Finding]]]
    status: str = ""
    listed: Sequence[PdoFinding] = ()


class EditedFile(Protocol):
    """A file whose PDOs are edited."""

    @property
    def file(self) -> str:
        """The file as named by the user."""
        ...

    @property
    def names(self) -> Mapping[int, str]:
        """The names of nodes in the file, by node-ID."""
        ...

    @property
    def options(self) -> Options:
        """The options of a session with simulated nodes for the file's nodes."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """The parts of the file that are not edited, a line each."""
        ...

    def fill(self, session: Session) -> None:
        """Set the simulated nodes of *session* to the values in the file."""
        ...

    def lacks(self, link: EditedLink) -> bool:
        """Tell whether the file is written with an entry of its own for *link*."""
        ...

    def link_note(self, link: EditedLink) -> str:
        """Say as what the file keeps *link*, and which link ends by it; empty for PDOs alone."""
        ...

    def offered_watch_ms(self, link: EditedLink, slots: Mapping[int, int]) -> int | None:
        """Return a time for which the consumer of *link* may watch the producer's heartbeat; None if nothing asks it.

        *slots* are the entries of the consumer's 0x1016.
        """
        ...

    def judge(self, edits: Edits) -> Judged:
        """Return the findings of the rules about the file with *edits*."""
        ...

    def write(self, session: SessionUser, edits: Edits, file: str) -> str:
        """Write the file with *edits* as *file*, after a question if it exists; returns the result."""
        ...


def file_to_edit(file: str) -> EditedFile:
    """Read *file*, a network file, a DCF or an XDC.

    Raises UsageError for another suffix, and the errors of reading it.
    """
    name = file.lower()
    if name.endswith(NETWORK_SUFFIXES):
        return EditedNetwork(OpenedFile(file, MOST_OF_NETWORK, "network file"), read_network_config(file))
    if name.endswith(VALUE_SUFFIXES):
        return EditedValues(OpenedFile(file, MOST_BYTES, "DCF or XDC"))
    raise UsageError(
        f"{file}: edit takes a PDO, a network file (.yaml), a DCF (.dcf) or an XDC (.xdc)",
        place=file,
        hint=_as_dcf(file) if name.endswith(_CONVERTED) else None,
    )


def _as_dcf(file: str) -> Hint:
    """Return the conversion of *file* to a DCF, which can be edited."""
    dcf = f"{file.rpartition('.')[0] or 'NAME'}.dcf"
    return Hint(Action.CONVERT, {"file": file, "target": dcf}, "{} makes a DCF, which can be edited")


def refuse_other_values(edited: str, file: str) -> None:
    """Raise UsageError if *file* is a DCF or XDC; *edited* is another kind of file.

    A simulated node has values of its own for the objects that the file does not name.
    """
    if not file.lower().endswith(VALUE_SUFFIXES):
        return
    if edited.lower().endswith(VALUE_SUFFIXES):
        hint = Hint(Action.CONVERT, {"file": edited, "target": file}, "{} makes it of the saved file")
    else:
        hint = as_hint(
            "a name in .yaml saves the network file; a DCF is exported from the device, once that is applied"
        )
    raise UsageError(
        f"{file} is not written: it has the values of a whole device, but {edited} has only some of them",
        place=file,
        hint=hint,
    )


class OpenedFile:
    """A file of *kind* with its *data* at opening, at most *most_bytes* long.

    Raises UsageError if it cannot be read, InputFileError if it is longer or no regular file.
    """

    def __init__(self, file: str, most_bytes: int, kind: str) -> None:
        self.file, self._most_bytes, self._kind = file, most_bytes, kind
        self.data = self._held = self._read()

    def _read(self) -> bytes:
        try:
            return read_input(Path(self.file), self._most_bytes, self._kind)
        except OSError as failed:
            raise UsageError(f"{self.file}: {failed.strerror or failed}", place=self.file) from failed

    def is_at(self, path: Path) -> bool:
        """Whether *path* is this file."""
        # Path.exists raises OSError for a name that is too long
        return os.path.exists(path) and os.path.exists(self.file) and os.path.samefile(path, self.file)  # noqa: PTH110, PTH121

    def replace(self, session: SessionUser, path: Path, content: bytes, lost: Sequence[str] = ()) -> None:
        """Write *content* as *path*; if it exists, after a question that names the *lost* parts.

        Raises UsageError if *path* is this file, and another program wrote it.
        """
        self._refuse_written(path)
        if os.path.exists(path):  # noqa: PTH110
            without = f", which loses {join_some(lost)}" if lost else ""
            session.consent(f"{path} exists; overwrite it{without}?")
            self._refuse_written(path)
        make_file(session, path, content)
        if self.is_at(path):
            self._held = content

    def copy(self, session: SessionUser, path: Path) -> str:
        """Write the bytes read at opening as *path*; returns the result in words."""
        if self.is_at(path):
            return f"nothing to write: {path} already has these values"
        self.replace(session, path, self.data)
        return f"{path}: a copy of {self.file}, without changes"

    def _refuse_written(self, path: Path) -> None:
        if self.is_at(path) and self._read() != self._held:
            raise UsageError(
                f"{path} was changed by another program and is not overwritten",
                place=str(path),
                hint="F2 saves under another name",
            )


class EditedNetwork:
    """A network file as *config*; nodes without a description are kept, and not edited."""

    def __init__(self, opened: OpenedFile, config: NetworkConfig) -> None:
        self._opened, self._config = opened, config
        self.file = file = opened.file
        self._words = words_of(file, config)
        if not self._words:
            raise UsageError(
                f"{file}: its nodes have no EDS, so their PDOs are unknown",
                place=file,
                hint="set dcf: next to node_id",
            )

    @property
    def names(self) -> Mapping[int, str]:
        """The names of the file's nodes, by node-ID."""
        return {node.node_id: node.name for node in self._config.nodes}

    @property
    def options(self) -> Options:
        """The options that simulate the described nodes."""
        return simulation_of(self._words, force=True)

    @property
    def notes(self) -> tuple[str, ...]:
        """The nodes that are not edited."""
        others = [str(node.node_id) for node in self._config.nodes if node.node_id not in self._words]
        return (f"no EDS of {all_nodes(others)}: this part of the file is kept unchanged",) if others else ()

    def fill(self, session: Session) -> None:
        """Set the nodes to the PDOs in the file; raises UsageError if a rule or a simulated node refuses them."""
        session.bus.read_at_once()
        try:
            state = described_network(self.file, config=self._config)
            for node_id in self._words:
                _hold(session, session.node(node_id), state)
        except (RuleError, DeviceRefused) as refused:
            is_named = refused.node is None or f"node {refused.node} " in refused.text
            said = refused.text if is_named else f"node {refused.node}: {refused.text}"
            raise UsageError(
                f"{self.file} cannot be edited: {said}; its nodes are simulated, no device was touched",
                node=refused.node,
                place=self.file,
                abort=refused.abort,
                why=refused.why,
                hint=Hint(Action.CHECK, {"file": self.file}, "{} lists the error; correct it first"),
            ) from refused

    def lacks(self, link: EditedLink) -> bool:
        """Tell whether *link* is new to the section `links`, or comes with a heartbeat consumer."""
        if not self._config.links:
            return link.watch_ms is not None
        return not any(link.producer == old.producer and link.consumer in old.consumers for old in self._config.links)

    def link_note(self, link: EditedLink) -> str:
        """Say that *link* stands in the section `links`, if there is one, and in whose place."""
        if not self._config.links:
            return ""
        others = [old.producer for old in self._config.links if link.consumer in old.consumers]
        instead = [f"{end.node_id}:{end.pdo}" for end in others if end != link.producer]
        return f"kept in links{f', instead of that from {join_some(instead)}' if instead else ''}"

    def offered_watch_ms(self, link: EditedLink, slots: Mapping[int, int]) -> int | None:
        """Return a time if the file has the producer's heartbeat; in a file with `links` the link sets it up."""
        config = self._config
        nodes = {node.node_id: node for node in config.nodes}
        producer, consumer = nodes[link.producer.node_id], nodes[link.consumer.node_id]
        sent = [made.data for made in producer.objects if made.key == "heartbeat_producer"]
        period_ms = int.from_bytes(sent[-1], "little") if sent else 0
        is_watched = any(watch.producer == producer.node_id for watch in consumer.watches)
        if config.links or not period_ms or is_watched or len(consumer.watches) >= len(slots):
            return None
        return watch_time_ms(period_ms, CONSUMER_PERIODS if config.multiplier is None else config.multiplier)

    def judge(self, edits: Edits) -> Judged:
        """Return the findings of `check`, and the worst-case bus load."""
        config, _remarks = self._with(edits)
        state, found = judged_file(self.file, config, CheckOptions())
        findings: dict[int, dict[Pdo, tuple[PdoFinding, ...]]] = {node.node_id: {} for node in config.nodes}
        shown = [row for row in found if not row.is_aside and row.severity != Severity.NOTE]
        listed = []
        for row in shown:
            listed.append(PdoFinding(row.rule, Severity(row.severity), _place(row), row.text))
            if row.node in findings and row.pdo is not None:
                pdo, of_node = Pdo.parse(row.pdo), findings[row.node]
                finding = PdoFinding(row.rule, Severity(row.severity), row.object or pdo.label, row.text)
                of_node[pdo] = (*of_node.get(pdo, ()), finding)
        errors = sum(row.severity == Severity.ERROR for row in shown)
        listed_by = ": c lists them" if shown else ""
        counts = f"check: {plural(errors, 'error')}, {plural(len(shown) - errors, 'warning')}{listed_by}"
        return Judged(findings, f"{_load_text(state)}; {counts}", listed)

    def write(self, session: SessionUser, edits: Edits, file: str) -> str:
        """Write all nodes, after a question that names the parts of the old file that are lost."""
        path = place_of(file, "NAME.yaml")
        if not edits:
            return self._opened.copy(session, path)
        config, remarks = self._with(edits)
        in_order = replace(config, nodes=tuple(sorted(config.nodes, key=lambda node: node.mark)))
        text = write_network(in_order, "", remarks)
        old = self._opened.data.decode("utf-8-sig")
        lost = list(_lost(old, config, read_network(text, str(path))))
        self._opened.replace(session, path, text.encode(), lost)
        return f"{path}: {edits} written"

    def _with(self, edits: Edits) -> tuple[NetworkConfig, dict[tuple[int, str], str]]:
        """Return the file's configuration with *edits*, and remarks on new words."""
        remarks: dict[tuple[int, str], str] = {}
        has_links = bool(self._config.links)
        linked = {link.consumer for link in edits.links} if has_links else set()
        nodes = []
        for node in self._config.nodes:
            new = edits.nodes.get(node.node_id)
            made = node if new is None else _node_with(node, new, remarks, linked)
            nodes.append(made if has_links else _watching(made, edits.links))
        links = _links_with(self._config.links, edits.links) if has_links else ()
        return replace(self._config, nodes=tuple(nodes), links=links), remarks


def _links_with(links: Sequence[LinkConfig], new: Sequence[EditedLink]) -> tuple[LinkConfig, ...]:
    """Return *links* with the *new* links: an RPDO receives one TPDO, a TPDO has one entry."""
    moved = {link.consumer for link in new}
    kept = {link.producer: tuple(end for end in link.consumers if end not in moved) for link in links}
    for link in new:
        kept[link.producer] = (*kept.get(link.producer, ()), link.consumer)
    heartbeats = {link.producer: link.heartbeat for link in links}
    return tuple(LinkConfig(end, consumers, heartbeats.get(end)) for end, consumers in kept.items() if consumers)


def _watching(node: NodeConfig, links: Sequence[EditedLink]) -> NodeConfig:
    """Return *node* with a heartbeat consumer for each of *links* that it receives and that has a time."""
    watches = {
        link.producer.node_id: HeartbeatWatch(link.producer.node_id, link.watch_ms)
        for link in links
        if link.consumer.node_id == node.node_id and link.watch_ms is not None
    }
    return replace(node, watches=(*node.watches, *watches.values()))


def _hold(session: SessionNodes, node: Node, state: NetworkState) -> None:
    """Set the simulated *node* to its PDOs in *state*."""
    now, wanted = node.pdos(), state.node(node.node_id)
    changes: dict[Pdo, PdoConfig] = {}
    for pdo, config in (wanted.pdos if wanted is not None else {}).items():
        held = now.get(pdo)
        if held is None:
            continue
        if config.communication.transmission_type is None:  # the file's EDS has no default
            kind = held.communication.transmission_type
            config = config.with_parameters(transmission_type=kind)  # noqa: PLW2901
        if config != held:
            changes[pdo] = config
    if changes:
        configure(session, node, changes)


def _node_with(
    node: NodeConfig, edited: Edited, remarks: dict[tuple[int, str], str], linked: Collection[Endpoint]
) -> NodeConfig:
    """Return *node* with the parameters that *edited* changes; the others stay as the file has them.

    The RPDOs of *linked* have what their link gives from it, unless the file says otherwise.
    """
    said = {config.pdo: config for config in node.pdos}
    words: dict[str, str] = {}
    for pdo, config in edited.changed.items():
        old = said.get(pdo, PartialPdoConfig(pdo))
        new = _pdo_with(old, edited, edited.held[pdo], config, words)
        said[pdo] = _without_link(old, new) if Endpoint(node.node_id, pdo) in linked else new
    remarks |= {(node.node_id, word): text for word, text in words.items()}
    order = sorted(said, key=lambda pdo: (not pdo.is_tpdo, pdo.number))  # that of the reader
    return replace(node, pdos=tuple(said[pdo] for pdo in order))


def _without_link(old: PartialPdoConfig, new: PartialPdoConfig) -> PartialPdoConfig:
    """Return *new* without the CAN-ID and `enabled`, which a link gives, unless *old* has them."""
    if old.enabled is None:
        new = replace(new, enabled=None)
    if isinstance(old.cob_id, int):
        return new
    return replace(new, cob_id=old.cob_id, extended=old.extended, rtr_allowed=old.rtr_allowed)


def _pdo_with(
    said: PartialPdoConfig, edited: Edited, held: PdoConfig, config: PdoConfig, words: dict[str, str]
) -> PartialPdoConfig:
    """Return *said* with the parameters of *config* that differ from *held*."""
    before, after = held.communication, config.communication
    changes: dict[str, object] = {}
    if config.enabled != held.enabled:
        changes["enabled"] = config.enabled
    if (after.cob_id.can_id, after.cob_id.extended) != (before.cob_id.can_id, before.cob_id.extended):
        changes |= {"cob_id": after.cob_id.can_id, "extended": after.cob_id.extended}
        if not after.cob_id.rtr_allowed:
            changes["rtr_allowed"] = False
    for name in ("transmission_type", "inhibit_time", "event_timer", "sync_start_value"):
        if getattr(after, name) != getattr(before, name):
            changes[name] = getattr(after, name)
    if config.mapping != held.mapping:
        changes["mapping"] = tuple(mapped_word(edited.node, entry, words) for entry in config.mapping)
    return replace(said, **changes)  # type: ignore[arg-type]


def _place(row: NetworkFinding) -> str:
    """Return what a finding of `check` is about: `5:rpdo1`, a node, or the file's line."""
    if row.node is None:
        return f"line {row.line}"
    return f"node {row.node}" if row.pdo is None else f"{row.node}:{row.pdo}"


def _load_text(state: NetworkState) -> str:
    rate = state.bit_rate or USUAL_BIT_RATE
    need = worst_case_load(streams_of(state), rate)
    share = f"bus load {float(need.limited) * 100:.1f} % at {rate // 1000} kbit/s"
    unlimited = f" and {plural(len(need.unlimited), 'unlimited frame')}" if need.total is None else ""
    return f"{share}{'' if state.bit_rate else ' (assumed)'}{unlimited}"


def _lost(old: str, config: NetworkConfig, written: NetworkConfig) -> Iterator[str]:
    """Name the parts of the text *old* that the new file, read back as *written*, has no more.

    Raises UsageError if it is more than comments, keys that dvtcli does not use, and the bit rate of the master.
    """
    comments = sum(_COMMENT.search(line) is not None for line in old.splitlines())
    if comments:
        yield plural(comments, "comment")
    tree = read_tree(old, FileLog("", old))
    if isinstance(tree, Branch) and "defaults" in tree.items:
        yield "the section `defaults`, which is copied into each node"
    aliases = count_aliases(old)
    if aliases:
        yield f"{plural(aliases, 'reference')} to anchors, copied out in full"
    kept = {note.text for note in written.notes}
    yield from dict.fromkeys(note.text for note in config.notes if note.text not in kept)
    if config != written:
        names = [node.name for node, new in zip(config.nodes, written.nodes, strict=False) if node != new]
        raise UsageError(
            f"not written: the file would change {join_some(names) or 'its links or options'}",
            hint="change the text of the file instead",
        )


class EditedValues:
    """A DCF or XDC; its values of PDOs are edited."""

    notes: tuple[str, ...] = ()
    names: Mapping[int, str] = {}

    def __init__(self, opened: OpenedFile) -> None:
        self._opened, self.file = opened, opened.file

    @property
    def options(self) -> Options:
        """The options that simulate the DCF's device."""
        return Options(sim=(str(Path(self.file)),), force=True)

    def fill(self, session: Session) -> None:
        """Do nothing: a simulated device holds the values of its DCF or XDC."""
        session.bus.read_at_once()

    def lacks(self, _link: EditedLink) -> bool:
        """Return False: neither DCF nor XDC has links."""
        return False

    def link_note(self, _link: EditedLink) -> str:
        """Return nothing: neither DCF nor XDC has links."""
        return ""

    def offered_watch_ms(self, _link: EditedLink, _slots: Mapping[int, int]) -> int | None:
        """Return None: neither DCF nor XDC has links."""
        return None

    def judge(self, edits: Edits) -> Judged:
        """Return the findings of `map`."""
        findings = {id_: judge_edited(node.node, node.held, node.changed) for id_, node in edits.nodes.items()}
        return Judged(findings)

    def write(self, session: SessionUser, edits: Edits, file: str) -> str:
        """Write the values of the edited PDOs; every other byte of the file stays."""
        path = place_of(file, f"NAME{Path(self.file).suffix.lower()}")
        if not edits:
            return self._opened.copy(session, path)
        values: dict[ObjectAddress, bytes] = {}
        ((node_id, node),) = edits.nodes.items()
        for _change, step in edited_plan(node_id, node.held, node.changed).steps_in_order():
            values[step.index, step.sub_index] = step.after
        text = change_values(self._opened.data, Path(self.file).name, values, node_id)
        if text.left_out:
            out = join_some(f"{index:04X}:{sub:02X} ({why})" for (index, sub), why in text.left_out.items())
            raise UsageError(f"{path} is not written: it cannot have {out}", place=str(path))
        self._opened.replace(session, path, text.data)
        return f"{path}: {edits} written"
