"""Logging in to a device that keeps its writes behind access levels.

Knows the sequence that a profile names. Does not know where a passcode comes from, and neither keeps nor shows one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.rules.finding import ERROR, Finding, Rule, error
from dvtcli.errors import DeviceRefused, DvtcliError, SafetyRefusal, SdoAborted, UsageError

if TYPE_CHECKING:
    from dvtcli.device.nmt_gate import NodeAccess
    from dvtcli.domain.plan import Plan
    from dvtcli.domain.profile import LoginPolicy

RULES = (
    Rule("access-level", ERROR, "the device is not logged in at the level that the write needs", "the family",
         (Abort.GENERAL,)),
)  # fmt: skip


def access_level(access: NodeAccess) -> int:
    """The access level that the device is at, 0 for logged out; DvtcliError where its family has no login."""
    level = policy_of(access).level
    return int.from_bytes(access.bus.sdo(access.node_id).upload(*level), "little")


def policy_of(access: NodeAccess) -> LoginPolicy:
    """How the device is logged in to; DvtcliError where its family has no login."""
    if access.profile.login is not None:
        return access.profile.login
    raise DvtcliError(
        f"node {access.node_id} ({access.profile.title}) has no login",
        node=access.node_id,
        hint=Hint(Action.SHOW_NODE, {"node": access.node_id}, "tells its profile")
        + Hint(Action.GIVE_PROFILE, why="takes another, should it be wrong"),
    )


def log_in(access: NodeAccess, wanted: int, passcode: Callable[[], int], user: int | None = None) -> int:
    """Bring the device to access level *wanted* or above (0: log out); the level it is at then.

    *passcode* is asked for a number 0..0xFFFF only where one is needed; *user* is the user ID (1..0xFFFF), None for
    the family's. Raises UsageError for a level that the family does not have, DeviceRefused where it is not reached.
    Source: the published Gen4 manual, login.
    """
    policy = policy_of(access)
    if not 0 <= wanted <= policy.highest:
        raise UsageError(f"access levels of a {access.profile.title} are 0…{policy.highest}", node=access.node_id)
    if not wanted:
        return _log_out(access, policy)
    held = access_level(access)
    if held >= wanted:
        return held
    code = passcode()  # asked for before anything is written: there may be none
    _introduce(access, policy, policy.user if user is None else user)
    try:
        _present(access, policy, code)
    except SdoAborted as aborted:
        access.explain(aborted)
        raise _not_reached(access, wanted, aborted) from aborted
    held = access_level(access)
    if held < wanted:
        raise _not_reached(access, wanted, None)
    return held


def _log_out(access: NodeAccess, policy: LoginPolicy) -> int:
    _introduce(access, policy, 0)
    _present(access, policy, 0)
    return access_level(access)


def _introduce(access: NodeAccess, policy: LoginPolicy, user: int) -> None:
    """Write the user ID; some firmware aborts this one write and takes the passcode all the same."""
    try:
        access.bus.sdo(access.node_id).download(*policy.user_id, user.to_bytes(2, "little"))
    except SdoAborted:
        return


def _present(access: NodeAccess, policy: LoginPolicy, passcode: int) -> None:
    access.bus.sdo(access.node_id).download(*policy.passcode, passcode.to_bytes(2, "little"))


def _not_reached(access: NodeAccess, wanted: int, aborted: SdoAborted | None) -> DeviceRefused:
    policy = policy_of(access)
    held = access_level(access)
    refused = DeviceRefused(
        f"node {access.node_id} was not logged in at level {wanted}: it is at level {held}",
        node=access.node_id,
        place=f"{policy.passcode[0]:04X}:{policy.passcode[1]:02X}",
        abort=aborted.code if aborted else None,
        why=aborted.why if aborted else "the passcode is one for another level",
        hint=Hint(Action.GIVE_USER, why="is it the passcode of this level, and of this user ({})?"),
    )
    refused.state_text = "no setting was written, only the user ID and a passcode"
    return refused


def refuse_passcode(access: NodeAccess, index: int, sub_index: int) -> None:
    """Raise SafetyRefusal where a raw write is about to send a passcode, which its words have shown already."""
    policy = access.profile.login
    if policy is not None and (index, sub_index) == policy.passcode:
        raise SafetyRefusal(
            f"0x{index:04X}:{sub_index:02X} takes a passcode, and a command line is no place for one",
            node=access.node_id,
            place=f"{index:04X}:{sub_index:02X}",
            hint=Hint(Action.LOG_IN, why="asks for it without echo"),
        )


def level_findings(access: NodeAccess, plan: Plan) -> tuple[Finding, ...]:
    """An error where *plan* writes what the device's access level does not allow; reads the level, writes nothing."""
    policy = access.profile.login
    if policy is None or not any(policy.asked_for(step.index) for step in plan.steps):
        return ()
    return level_finding(access)


def level_finding(access: NodeAccess) -> tuple[Finding, ...]:
    """An error where the device's access level is too low for PDO work and storing; none where that is not known."""
    policy = access.profile.login
    if policy is None:
        return ()
    try:
        held = access_level(access)
    except SdoAborted:
        return ()  # the device decides
    if held >= policy.needed:
        return ()
    place = f"0x{policy.level[0]:04X}:{policy.level[1]:02X}"
    text = f"the access level is too low: it is {held}, and this needs {policy.needed}"
    return (error("access-level", place, text, Abort.GENERAL, Hint(Action.LOG_IN, {"level": policy.needed})),)
