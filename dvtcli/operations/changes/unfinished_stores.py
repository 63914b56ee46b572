"""Report failed stores of a network: stored nodes, missing nodes, remedy. Asks no node."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dvtcli.device.change.failed_change import BUS_BACK, also_lines, brought_back_first
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.store import WhoStored
from dvtcli.domain.text import join_some
from dvtcli.errors import BusUnavailable, DeviceRefused, DvtcliError, LeftChanged, NoAnswer, SdoProtocolError

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.change.change_group import Storing
    from dvtcli.operations.results import Stored

#: What to do if a node lost its values, without a journal.
_AGAIN = Hint(Action.APPLY, why="{} again sets the missing values, and stores them")
_ALL_BACK = Hint(Action.RECOVER_ALL, why=", {} puts every node back")


@dataclass(slots=True)
class Stores:
    """The stores of a whole change in progress, by node-ID; *lost*: faults of nodes that lost values.

    *equal* are nodes that were as wanted and neither change nor store.
    """

    states: dict[int, Storing]
    equal: tuple[Storing, ...] = ()
    answers: dict[int, Stored] = field(default_factory=dict)
    failed: dict[int, BaseException] = field(default_factory=dict)
    lost: list[BaseException] = field(default_factory=list)
    #: whether the message about a late request to stop was shown
    was_late: bool = False

    def are_all_done(self) -> bool:
        """Tell whether every node has acknowledged its store."""
        return not any(state.waits for state in self.states.values())


def not_all_stored(stores: Stores, journals: Sequence[Path], unstamped: Sequence[int]) -> LeftChanged:
    """Report failed stores while every node still holds its planned values.

    *journals* allow a roll-back or the missing stores. The planned stamps of the *unstamped* nodes are 0, as these have
    not stored.
    """
    first, fault = next(iter(stores.failed.items()))
    refused = [node_id for node_id, failure in stores.failed.items() if not _is_unsure(failure)]
    spoilt = [node_id for node_id, failure in stores.failed.items() if _is_spoilt(failure)]
    unsure = [node_id for node_id in stores.failed if node_id not in (*refused, *spoilt)]
    said = [f"whether node {join_some(map(str, unsure))} stored it is not known"] if unsure else []
    said += [_spoilt_text(spoilt)] if spoilt else []
    said += [f"node {join_some(map(str, refused))} did not store it"] if refused else []
    left = LeftChanged(
        f"{_held(stores, unstamped)}, and {', and '.join(said)}",
        node=first,
        place=fault.place if isinstance(fault, DvtcliError) else None,
        why="; ".join(str(exception) or "interrupted" for exception in stores.failed.values()),
        hint=Hint(Action.FINISH_STORES, why="asks the nodes that have not stored again").after(
            brought_back_first(fault.hint if isinstance(fault, DvtcliError) else None)
        )
        + _ALL_BACK,
        state="left_changed",
    )
    _say_who(stores, left)
    if journals:
        left.details.append(("journals", join_some(map(str, journals))))
    left.state_text = f"{_held(stores, unstamped)}, read back equal; not all of them have stored it"
    return left


def _held(stores: Stores, unstamped: Sequence[int]) -> str:
    """Say who holds planned values: accepted nodes are unverified; a stamp is 0 until its node stores."""
    accepted = [node_id for node_id, state in stores.states.items() if state.is_accepted]
    who = f"every node except {join_some(map(str, accepted))}, accepted as found," if accepted else "every node"
    but = (
        f" but the stamp of node {join_some(map(str, unstamped))}, which is 0 until the node has stored"
        if unstamped
        else ""
    )
    return f"{who} has the planned values{but}"


def only_some_stored(node_ids: Sequence[int], outcomes: Mapping[int, Stored | BaseException]) -> LeftChanged | None:
    """Report that only some of *node_ids*, stored one by one, have stored; None if none or all did.

    *outcomes* has the answer or the error of each node asked.
    """
    faults = {node_id: outcome for node_id, outcome in outcomes.items() if isinstance(outcome, BaseException)}
    answers = {node_id: outcome for node_id, outcome in outcomes.items() if not isinstance(outcome, BaseException)}
    stored = tuple(node_id for node_id, answer in answers.items() if answer.stored)
    kept = [*stored, *(node_id for node_id, answer in answers.items() if answer.skipped)]
    unsure = tuple(node_id for node_id, fault in faults.items() if _is_unsure(fault))
    spoilt = [node_id for node_id, fault in faults.items() if _is_spoilt(fault)]
    untold = [node_id for node_id in unsure if node_id not in spoilt]
    missing = tuple(node_id for node_id in node_ids if node_id not in (*kept, *unsure))
    if not stored or not (unsure or missing):
        return None
    said = [f"node {join_some(map(str, missing))} did not"] if missing else []
    said += [_spoilt_text(spoilt)] if spoilt else []
    said += [f"whether node {join_some(map(str, untold))} stored is not known"] if untold else []
    first = next(iter(faults.values()), None)
    error = LeftChanged(
        f"node {join_some(map(str, stored))} stored, and {', and '.join(said)}",
        node=(*missing, *unsure)[0],
        place=first.place if isinstance(first, DvtcliError) else None,
        why="; ".join(f"node {node_id}: {str(fault) or 'interrupted'}" for node_id, fault in faults.items()) or None,
        hint=Hint(Action.STORE, {"node": sorted((*missing, *unsure))}, "stores the rest").after(
            BUS_BACK if any(isinstance(fault, BusUnavailable) for fault in faults.values()) else None
        ),
        state="left_changed",
    )
    error.stores = WhoStored(stored, missing, unsure)
    error.details = error.stores.rows()
    error.state_text = "the stored values stay stored"
    return error


def only_some_restored(node_ids: Sequence[int], outcomes: Mapping[int, Stored | BaseException]) -> LeftChanged | None:
    """Report that only some of *node_ids*, one by one, restored their defaults; None if none or all did alike."""
    faults = {node_id: outcome for node_id, outcome in outcomes.items() if isinstance(outcome, BaseException)}
    answers = {node_id: outcome for node_id, outcome in outcomes.items() if not isinstance(outcome, BaseException)}
    restored = [node_id for node_id, answer in answers.items() if answer.exit_code == 0]
    unproved = [node_id for node_id in answers if node_id not in restored]
    unsure = [node_id for node_id, fault in faults.items() if _is_unsure(fault)]
    missing = [node_id for node_id in node_ids if node_id not in (*answers, *unsure)]
    if not answers or len(node_ids) in (len(restored), len(unproved)):
        return None
    rest = sorted((*unproved, *unsure, *missing))
    said = [f"node {join_some(map(str, restored))} restored its defaults"] if restored else []
    said += [f"node {join_some(map(str, unproved))} may not have its defaults (not proved)"] if unproved else []
    said += [f"node {join_some(map(str, missing))} did not"] if missing else []
    said += [f"whether node {join_some(map(str, unsure))} restored them is not known"] if unsure else []
    return LeftChanged(
        ", and ".join(said),
        node=rest[0],
        why="; ".join(f"node {node_id}: {str(fault) or 'interrupted'}" for node_id, fault in faults.items()) or None,
        hint=Hint(Action.RESTORE, {"node": rest}, "restores the rest"),
        state="left_changed",
    )


def lost_besides(stores: Stores, lost: BaseException) -> LeftChanged:
    """Report that all written values are held and stored, but another planned value differs."""
    left = LeftChanged(
        f"every node that was written stored, and then: {lost}",
        node=lost.node if isinstance(lost, DvtcliError) else None,
        place=lost.place if isinstance(lost, DvtcliError) else None,
        why=lost.why if isinstance(lost, DvtcliError) else None,
        hint=_AGAIN,
        state="left_changed",
    )
    _say_who(stores, left)
    left.state_text = "every other node has the planned values and has stored them"
    return left


def back_and_again(name: str, who: str = "every node") -> Hint:
    """Suggest the roll-back for *who*, then *name* again: for all nodes, whichever is selected."""
    back = Hint(Action.RECOVER_ALL, why=f"rolls {who} back")
    command, _, file = name.partition(" ")
    if command == "apply" and file:
        return back + Hint(Action.APPLY_NETWORK, {"file": file}, "then {} again")
    return back + f"then {name} again"


def lost_settings(name: str, stores: Stores, lost: Sequence[BaseException]) -> LeftChanged:
    """Report nodes that no longer hold planned values (*lost*): nothing of these must be stored.

    *name* is the name of the change.
    """
    first, *others = lost
    left = LeftChanged(
        _lost_text(stores, first),
        node=first.node if isinstance(first, DvtcliError) else None,
        place=first.place if isinstance(first, DvtcliError) else None,
        why=(first.why if isinstance(first, DvtcliError) else None) or "seen while the nodes stored",
        hint=back_and_again(name),
        state="left_changed",
    )
    is_gone = isinstance(first, BusUnavailable)
    if is_gone or (stores.are_all_done() and not isinstance(first, DvtcliError)):
        goes_on = "reads every node again" if stores.are_all_done() else "continues with the stores"
        left.hint = Hint(Action.FINISH_STORES, why=goes_on).after(BUS_BACK if is_gone else None) + _ALL_BACK
    if isinstance(first, LeftChanged):
        finish = Hint(Action.FINISH_STORES, why="rolls that back and continues the stores")
        left.hint = finish.after(brought_back_first(first.hint)) + _ALL_BACK
        left.details += first.details
    left.details += also_lines(left, others)
    _say_who(stores, left)
    left.state_text = "not every node is known to have the planned values; stored values remain stored"
    return left


def _lost_text(stores: Stores, first: BaseException) -> str:
    if isinstance(first, BusUnavailable) and stores.are_all_done():
        return f"all nodes have stored, but the bus failed before every node was read again: {first}"
    if isinstance(first, BusUnavailable):
        return f"the bus was gone while the nodes stored: {first}"
    return str(first) or "stopped before every node was read again"


def _say_who(stores: Stores, left: LeftChanged) -> None:
    """Add stored, missing and unknown nodes to *left*, for screens and programs."""
    done = tuple(state.node_id for state in stores.states.values() if state.is_done)
    unsure = tuple(node_id for node_id, failure in stores.failed.items() if _is_unsure(failure))
    missing = tuple(state.node_id for state in stores.states.values() if state.waits and state.node_id not in unsure)
    lost = {fault.node for fault in stores.lost if isinstance(fault, DeviceRefused)}
    not_held = tuple(node_id for node_id in done if node_id in lost)
    left.stores = WhoStored(tuple(node_id for node_id in done if node_id not in lost), missing, unsure, not_held)
    left.details += left.stores.rows()


def _spoilt_text(spoilt: Sequence[int]) -> str:
    return f"node {join_some(map(str, spoilt))} refused to store: its stored values are unknown"


def _is_spoilt(fault: BaseException) -> bool:
    """Tell whether a store failed in the node, so that its stored parameters may be lost."""
    return isinstance(fault, DeviceRefused) and fault.abort is not None and fault.state == "unknown"


def _is_unsure(fault: BaseException) -> bool:
    """Tell whether it is unknown if the node stored."""
    if not isinstance(fault, DvtcliError):
        return True
    lost = isinstance(fault, BusUnavailable | NoAnswer | SdoProtocolError)
    return lost or fault.state in ("unknown", "left_changed")


def hint_without_journal(lost: BaseException, acknowledged: Collection[int] = ()) -> Hint | str | None:
    """Suggest a remedy if *lost* values are in no journal."""
    if isinstance(lost, LeftChanged):
        return lost.hint
    if isinstance(lost, DeviceRefused) and lost.node is not None and lost.node in acknowledged:
        why = "{} shows whether the stored values survive a reset; the manual of the node describes how it stores"
        return Hint(Action.PROVE_STORE, {"node": (lost.node,)}, why)
    return _AGAIN.after(BUS_BACK if isinstance(lost, BusUnavailable) else None)
