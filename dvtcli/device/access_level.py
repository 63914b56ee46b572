"""Log in to a device that protects writes by access levels, in the sequence of its profile. Stores no passcode."""

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
    """The device's current access level, 0 if logged out. Raises DvtcliError if its family has no login."""
    level = policy_of(access).level
    return int.from_bytes(access.bus.sdo(access.node_id).upload(*level), "little")


def policy_of(access: NodeAccess) -> LoginPolicy:
    """The login rules of the device's family. Raises DvtcliError if the family has no login."""
    if access.profile.login is not None:
        return access.profile.login
    raise DvtcliError(
        f"node {access.node_id} ({access.profile.title}) has no login",
        node=access.node_id,
        hint=Hint(Action.SHOW_NODE, {"node": access.node_id}, "tells its profile")
        + Hint(Action.GIVE_PROFILE, why="uses another profile if it is wrong"),
    )


def log_in(access: NodeAccess, wanted: int, passcode: Callable[[], int], user: int | None = None) -> int:
    """Bring the device to access level *wanted* or above (0: log out) and return the level reached.

    *passcode* is called for a number 0..0xFFFF only if the device needs a passcode; *user* is the user ID (1..0xFFFF),
    None for the family's. Raises UsageError if the family lacks the level, DeviceRefused if the device does not reach
    the level. Source: the published Gen4 manual, login.
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
        why=aborted.why if aborted else "the passcode is for another level",
        hint=Hint(Action.GIVE_USER, why="is it the passcode of this level, and of this user ({})?"),
    )
    refused.state_text = "no setting was written, only the user ID and a passcode"
    return refused


def refuse_passcode(access: NodeAccess, index: int, sub_index: int) -> None:
    """Raise SafetyRefusal if a raw write would send a passcode: the command line has shown the passcode already."""
    policy = access.profile.login
    if policy is not None and (index, sub_index) == policy.passcode:
        raise SafetyRefusal(
            f"0x{index:04X}:{sub_index:02X} is a passcode, which must not be on a command line",
            node=access.node_id,
            place=f"{index:04X}:{sub_index:02X}",
            hint=Hint(Action.LOG_IN, why="asks for it without echo"),
        )


def level_findings(access: NodeAccess, plan: Plan) -> tuple[Finding, ...]:
    """An error if *plan* writes more than the device's access level allows. Reads the level, writes nothing."""
    policy = access.profile.login
    if policy is None or not any(policy.asked_for(step.index) for step in plan.steps):
        return ()
    return level_finding(access)


def level_finding(access: NodeAccess) -> tuple[Finding, ...]:
    """An error if the access level is too low for PDO changes and storing; empty if the level is unknown."""
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
