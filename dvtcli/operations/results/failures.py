"""Make errors for results with exit code 1: reason, state of the device, next step.

The caller raises a result's failure unless it was shown as a document.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.text import join_some, plural
from dvtcli.errors import DvtcliError, RuleError

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import MissingObject
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.store import Proof


def not_proved(node: int, word: str, proof: Proof) -> DvtcliError:
    """Make the error for an acknowledged store or restore that was not proved."""
    said = f"node {node} acknowledged the {word}{_verdict(word, proof)}"
    failed = DvtcliError(said, node=node)
    failed.why, failed.hint, failed.state = proof.unproved, proof.hint, "unknown"
    failed.state_text = _state(word, proof)
    if proof.differences:
        differing = join_some(proof.differing)
        verb = "differs" if len(proof.differing) == 1 else "differ"
        failed.why = f"after the {proof.restart} {differing} {verb} from {proof.against}"
        failed.hint = _AGAIN[word]
    return failed


_AGAIN = {
    "store": "set it again; the manual says what else the device needs to store (a login, a state, another group)",
    "restore": "the EDS may be of another firmware; else the manual says what else the device needs to restore",
}


def _verdict(word: str, proof: Proof) -> str:
    if word == "store":
        return " but did not keep it" if proof.differences else ", and that it keeps it is not proved"
    return " and does not hold its defaults" if proof.differences else ", and that these are its defaults is not proved"


def _state(word: str, proof: Proof) -> str:
    """Describe the node's values read after the restart."""
    restart = proof.restart
    put_back = f"; {proof.put_back}" if proof.put_back else ""
    if proof.differences:
        lost = f"lost with the {restart}: {join_some(proof.differing)}; " if word == "store" else ""
        told = "what it came up with" if lost else "what is listed"
        return f"{lost}the node holds {told}, read after the {restart}{put_back}"
    if word == "restore":
        return f"the node holds what it came up with after the {restart}"
    return f"{compared_text(proof)} read back equal after the {restart}, and could be lost at power-off{put_back}"


def missing_error(lacking: Sequence[MissingObject]) -> RuleError:
    """Make the error for *lacking*, at least one: what devices lack of a file."""
    complaints = tuple(lacked.complaint for lacked in lacking if lacked.complaint is not None)
    place = f"{complaints[0].place}: " if complaints else ""
    ids = {lacked.node_id for lacked in lacking}
    findings = [lacked.finding for lacked in lacking]
    only = ids.pop() if len(ids) == 1 else None
    found = RuleError(f"{place}{findings[0].text}", findings, node=only, can_force=False)
    found.complaints = complaints
    found.abort = next((lacked.abort for lacked in lacking if lacked.abort), None)
    return found


def not_as_before(node: int | None, not_put_back: Sequence[Finding], *, dry_run: bool) -> DvtcliError:
    """Make the error for old values that the device does not take back.

    *node* is None for several nodes.
    """
    failed = DvtcliError("; ".join(finding.text for finding in not_put_back), node=node)
    failed.hint = Hint(Action.SHOW_PDOS, why="shows its present values") + Hint(
        Action.RESET_NODE, why="where it was stored, {} brings it back"
    )
    if not dry_run:
        failed.state = "left_changed"
        failed.state_text = "not as before; its present value was read back"
    return failed


def not_as_wanted(node: int | None, exit_code: int, differing: Sequence[str], against: str) -> DvtcliError:
    """Make the error of a script line whose comparison ended with *exit_code*: *differing*, or no frame.

    *node* is None for several nodes.
    """
    text = f"{join_some(differing)} {'differs' if len(differing) == 1 else 'differ'} from {against}"
    failed = DvtcliError(text if differing else "no frame was received from its producer", node=node)
    failed.exit_code = exit_code
    failed.state_text = "read back, nothing was written"
    return failed


def compared_text(proof: Proof) -> str:
    """How many PDOs, and objects besides, were compared."""
    pdos = plural(proof.compared, "PDO")
    if not proof.objects:
        return pdos
    objects = plural(proof.objects, "object")
    return f"{pdos} and {objects}" if proof.compared else objects


def not_obeyed(node: int, wanted: str | None, elsewhere: Sequence[tuple[int, str]]) -> DvtcliError:
    """Make the error for nodes in other NMT states (*elsewhere*) than *wanted* of node *node* (0: all)."""
    by_state: dict[str, list[str]] = {}
    for node_id, state in elsewhere:
        by_state.setdefault(state, []).append(str(node_id))
    seen = [
        f"node{'' if len(nodes) == 1 else 's'} {', '.join(nodes)} {'is' if len(nodes) == 1 else 'are'} {state}"
        for state, nodes in by_state.items()
    ]
    failed = DvtcliError(
        f"{', '.join(seen)}, not {wanted} as commanded",
        node=node or None,
        why="NMT commands are not acknowledged: it was ignored, or the node left that state again",
        hint=Hint(Action.READ, {"object": "1001"})
        + Hint(Action.MONITOR, why=" (error register) and {} (emergencies) tell more; then again"),
    )
    failed.state_text = f"{', '.join(by_state)}; nothing was written"
    return failed


#: actions of hints whose command needs a node
_OF_ONE_NODE = frozenset({Action.FIND_OBJECTS, Action.SHOW_PDOS})


def _with_node(finding: Finding, node: int) -> Finding:
    """Name *node* in the text of *finding* and in the commands of its hint."""
    text, hint = f"node {node}: {finding.text}", finding.hint
    if not isinstance(hint, Hint):
        return replace(finding, text=text)
    first, *others = (
        replace(step, arguments={"node": node, **step.arguments}, then=None)
        if step.action in _OF_ONE_NODE
        else replace(step, then=None)
        for step in hint
    )
    return replace(finding, text=text, hint=sum(others, start=first))


def together(refused: Sequence[RuleError]) -> RuleError:
    """Merge the errors of nodes into one with each finding once; findings name their nodes if several."""
    if len(refused) == 1:
        return refused[0]
    only = {error.node for error in refused}
    same = len(only) == 1 and None not in only
    named = (
        finding if same or error.node is None else _with_node(finding, error.node)
        for error in refused
        for finding in error.findings
    )
    findings = list(dict.fromkeys(named))
    text = refused[0].text if same or refused[0].node is None else findings[0].text
    can_force = all(error.can_force for error in refused)
    return RuleError(text, findings, node=only.pop() if same else None, can_force=can_force)
