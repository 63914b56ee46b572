"""Several nodes that keep their new node-IDs by LSS: all of them, or none, so that no power-on brings two with one.

Does not know files, nor how the nodes got them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.device.lss_master import LssMaster
from dvtcli.domain.several import several
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged
from dvtcli.operations.lss_node_id import take_back, told_id
from dvtcli.operations.lss_store import prove_by_reset, store
from dvtcli.operations.results.lss_nodes import LssGiven

if TYPE_CHECKING:
    from dvtcli.operations.session import Session


def store_all(master: LssMaster, given: Sequence[LssGiven], steps: Sequence[LssGiven]) -> list[LssGiven]:
    """Let each of *given* keep its node-ID; raises once all have what they had before *steps*, stored, too.

    LeftChanged where one has not: it says who has stored what.
    """
    stored: list[LssGiven] = []
    for one in given:
        try:
            stored.append(store(master, one))
        except DvtcliError as failed:
            failed.node = one.node_id
            failed.details.append(("refused" if isinstance(failed, DeviceRefused) else "silent", _who(one)))
            if stored:
                failed.details.append(("stored", several([_who(other) for other in stored])))
            doubtful = [] if isinstance(failed, DeviceRefused) else [one]
            raise _unstored(master, [*stored, *doubtful], steps, failed) from failed
    return stored


def prove_all(session: Session, master: LssMaster, stored: Sequence[LssGiven]) -> list[LssGiven]:
    """Reset each of *stored*, and see that it comes back with its node-ID; raises, and says who was not looked at."""
    proved: list[LssGiven] = []
    for number, one in enumerate(stored, 1):
        try:
            proved.append(prove_by_reset(session, master, one))
        except DvtcliError as failed:
            if proved:
                failed.details.append(("proved", several([_who(other) for other in proved])))
            if stored[number:]:
                failed.details.append(("stored", f"{several([_who(other) for other in stored[number:]])}, not proved"))
            raise
    return proved


def all_back(master: LssMaster, done: Sequence[LssGiven], failed: DvtcliError) -> DvtcliError:
    """*failed*, once those that were *done* have what they had; LeftChanged where one has not."""
    left: list[str] = []
    for one in reversed(done):
        try:
            take_back(master, one)
        except DvtcliError as stuck:
            left.append(f"{one.name} keeps node-ID {one.node_id}: {stuck.text}")
    if not left:
        return failed
    error = LeftChanged(failed.text, node=failed.node, why="; ".join(left), state="left_changed")
    error.details += failed.details
    error.hint = "nothing is stored: switch these off and on, then lss scan"
    return error


def _unstored(
    master: LssMaster, stored: Sequence[LssGiven], steps: Sequence[LssGiven], failed: DvtcliError
) -> DvtcliError:
    """*failed*, once all have what they had before *steps*, and those that may have *stored* another stored that."""
    error = all_back(master, steps, failed)
    left: list[str] = []
    for one in stored:
        try:
            store(master, replace(one, node_id=one.before))
        except DvtcliError as stuck:
            left.append(f"{_who(one)} may have node-ID {one.node_id} stored: {stuck.text}")
    if error is failed and not left:
        failed.state = "rolled_back"
        again = f"; {several([one.name for one in stored])} stored that again" if stored else ""
        failed.state_text = f"all have the node-IDs they had before{again}; nobody keeps a new one"
        failed.hint = "lss assign without --store; lss store NODE says again why it is not stored"
        return failed
    why = "; ".join([*([error.why] if error is not failed and error.why else []), *left])
    changed = LeftChanged(failed.text, node=failed.node, why=why, state="left_changed")
    changed.details += failed.details
    changed.hint = "before the power goes: lss scan and scan show who has which node-ID; lss store NODE for these"
    return changed


def _who(one: LssGiven) -> str:
    return f"{one.name} (node-ID {told_id(one.node_id)}, before {told_id(one.before)})"
