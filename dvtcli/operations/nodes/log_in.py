"""Log in to a device with access levels. Stores no passcode."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from dvtcli.device import access_level
from dvtcli.domain.script_line import login_line
from dvtcli.operations.results import LoggedIn

if TYPE_CHECKING:
    from dvtcli.domain.profile import LoginPolicy
    from dvtcli.operations.session.session import SessionNodes


def log_in(
    session: SessionNodes,
    passcode: Callable[[int, int], int],
    level: int | None = None,
    user: int | None = None,
    node_id: int | None = None,
) -> LoggedIn:
    """Log in to a node (None: the selected node) at *level* (0 logs out), None: the level for PDO work.

    *user* is the user ID, None for the family's. *passcode* is called with node-ID and level if the device needs a
    passcode. Raises DvtcliError if the device has no login, DeviceRefused if it rejects the passcode.
    """
    node = session.node(node_id)
    policy = access_level.policy_of(node.access)
    wanted = policy.needed if level is None else level
    before = access_level.access_level(node.access)
    held = access_level.log_in(node.access, wanted, lambda: passcode(node.node_id, wanted), user)
    if held != before and not session.dry_run:
        session.record.add(node.node_id, [login_line(wanted, user)])
    return LoggedIn(node.node_id, held, wanted, session.dry_run, _allows(policy, held))


def _allows(policy: LoginPolicy, level: int) -> str:
    if level >= policy.needed:
        return "PDOs can be written and stored"
    return f"PDOs can be read; writing and storing them needs level {policy.needed}"
