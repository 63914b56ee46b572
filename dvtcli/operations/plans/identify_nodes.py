"""Identify the nodes of a network file: those that answer and match, and why others do not.

Writes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.network.network_state import IDENTITY_NAMES
from dvtcli.domain.text import all_nodes
from dvtcli.errors import DvtcliError, InputFileError, NoAnswer, RuleError, SafetyRefusal, SdoProtocolError
from dvtcli.operations.plans.read_network_config import eds_of
from dvtcli.operations.results.failures import together

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_config import ExpectedIdentity, Mark, NetworkConfig, NodeConfig
    from dvtcli.domain.rules.finding import FileComplaint
    from dvtcli.operations.session.session import SessionNodes

#: Vendor, product, revision and serial number, by their sub-indices of 0x1018.
_IDENTITY_PARTS = range(1, 5)
_ATTACH = "connect the right device, or correct its identity in the file"
_OTHER_DCF = Hint(None, why="name the EDS of this device with dcf:; without an EDS fewer rules are checked") + Hint(
    Action.FORCE, why="uses this file"
)


@dataclass(slots=True)
class IdentifiedNodes:
    """The *nodes* that match the file, by node-ID, and the failures of the others.

    *boot_ups* counts the boot-ups received from each node before its first read.
    """

    nodes: dict[int, Node] = field(default_factory=dict)
    failures: list[DvtcliError] = field(default_factory=list)
    boot_ups: dict[int, int] = field(default_factory=dict)

    def end(self) -> None:
        """Raise one error for all failures, if any; failures that a retry cannot fix come first."""
        if not self.failures:
            return
        refused = [failure for failure in self.failures if isinstance(failure, RuleError)]
        others = [failure for failure in self.failures if not isinstance(failure, RuleError)]
        failures: list[DvtcliError] = [*others, together(refused)] if refused else others
        first, *others = sorted(failures, key=_weight)
        if isinstance(first, RuleError):  # force helps where it helps with everything
            first.can_force = first.can_force and not others
            first.complaints = first.complaints or tuple(placed_complaints([first]))
        if isinstance(first, InputFileError):
            first.complaints = (*first.complaints, *placed_complaints(refused))
        first.details += [("also", text) for other in others for text in _texts(other, first)]
        raise first


def identify_nodes(session: SessionNodes, file: str, config: NetworkConfig) -> IdentifiedNodes:
    """Identify the nodes of *config*, each with its EDS or profile."""
    identified = IdentifiedNodes()
    for node in config.nodes:
        _choose_files(session, file, node)
        identified.boot_ups[node.node_id] = session.bus.boot_ups(node.node_id)
    silent = _ask_all(session, [node.node_id for node in config.nodes])
    for node in config.nodes:
        try:
            if node.node_id in silent:
                raise silent[node.node_id]
            found = session.network.node(node.node_id)
            session.network.describe(node.node_id)
            described = node if session.options.eds is None else replace(node, dcf=None)
            failures = list(identity_errors(found, described, file, force=session.options.force))
        except (NoAnswer, SdoProtocolError) as failed:
            failures = [failed]
        identified.failures += failures
        if not failures:
            identified.nodes[node.node_id] = found
    _joined(identified.failures)
    return identified


def _ask_all(session: SessionNodes, ids: Sequence[int]) -> dict[int, DvtcliError]:
    """Identify *ids* again, in parallel if nothing else runs; returns the failures.

    Messages are left to the caller, which keeps the order of the file.
    """
    network = session.network
    silent: dict[int, DvtcliError] = {}

    def ask(node_id: int) -> None:
        try:
            known = network.nodes.get(node_id)
            if known is not None:
                known.read_anew()
            for sub_index in _IDENTITY_PARTS:
                read_identity(network.files.read_cache(node_id) if known is None else known.read_cache, sub_index)
        except (NoAnswer, SdoProtocolError) as failed:
            silent[node_id] = failed

    for fault in session.bus.side_by_side([partial(ask, node_id) for node_id in ids]):
        raise fault
    return silent


def _joined(failures: list[DvtcliError]) -> None:
    """Merge failures of silent nodes into one."""
    silent = [failure for failure in failures if isinstance(failure, NoAnswer) and failure.node is not None]
    if len(silent) > 1:
        silent[0].text = f"{all_nodes([failure.node for failure in silent])} do not answer"
        for answer in silent[1:]:
            failures.remove(answer)


def _choose_files(session: SessionNodes, file: str, node: NodeConfig) -> None:
    files, known = session.network.files, session.network.nodes
    if node.profile is not None and session.options.profile is None and node.node_id not in known:
        files.own_profile[node.node_id] = node.profile
    path = None if session.options.eds is not None else eds_of(file, node)
    if path is not None:
        files.own_eds[node.node_id] = path
    if node.modules is not None:
        files.own_modules[node.node_id] = node.modules


def is_wanted(node: ReadableNode, wanted: ExpectedIdentity) -> bool:
    """Tell whether *node* matches the identity *wanted*."""
    held = node.identity()
    parts = ((getattr(wanted, name), held[name]) for name in ("vendor", "product", "revision", "serial"))
    return all(number is None or number == told for number, told in parts)


def identity_errors(node: Node, config: NodeConfig, file: str, *, force: bool) -> Iterator[DvtcliError]:
    """Yield why *node* is not the device of *config* in *file*, or not the device of its EDS."""
    held = node.identity()
    for sub_index, name in zip(_IDENTITY_PARTS, IDENTITY_NAMES, strict=True):
        number = getattr(config.identity, name)
        if number is not None and held[name] != number:
            is_now = "none" if held[name] is None else f"0x{held[name]:08X}"
            what = f"node {node.node_id} has {name} {is_now}, not 0x{number:08X}"
            refused = SafetyRefusal(f"another device than the file describes: {what}", node=node.node_id, hint=_ATTACH)
            yield _placed(refused, file, config.identity_marks.get(sub_index))
    try:
        refuse_unlike_file(node.node_id, node.unlike_file, force=force)
    except SafetyRefusal as refused:
        if config.dcf is not None:
            refused.hint = _OTHER_DCF
        yield _placed(refused, file, None if config.dcf is None else config.dcf.mark)


def _placed(refused: SafetyRefusal, file: str, mark: Mark | None) -> SafetyRefusal:
    """Return *refused* with its place in *file*, if *mark* is known."""
    if mark is not None and mark.line:
        refused.place = f"{file}:{mark.line}:{mark.column}"
        refused.text = f"{refused.place}: {refused.text}"
    return refused


def _weight(failure: DvtcliError) -> int:
    kinds = (SafetyRefusal, InputFileError, RuleError)
    return next((number for number, kind in enumerate(kinds) if isinstance(failure, kind)), len(kinds))


def placed_complaints(refused: Sequence[RuleError]) -> Iterator[FileComplaint]:
    """Yield the findings of *refused* at their places in the file."""
    for error in refused:
        for finding in error.findings:
            if finding.complaint is not None:
                node = "" if error.node is None else f"node {error.node}: "
                yield replace(finding.complaint, text=f"{node}{finding.text}")


def _texts(failure: DvtcliError, told_by: DvtcliError) -> Iterator[str]:
    """Yield sentences of *failure* that are not among the file complaints of *told_by*."""
    if isinstance(failure, RuleError):
        node = "" if failure.node is None else f"node {failure.node}: "
        placed = isinstance(told_by, InputFileError)
        yield from (f"{node}{finding.text}" for finding in failure.findings if finding.complaint is None or not placed)
    elif isinstance(failure, InputFileError) and failure.complaints:
        yield from (f"{complaint.place}: {complaint.text}" for complaint in failure.complaints)
    else:
        yield failure.text
