#!/usr/bin/python
"""`undo` of the last change on a bus."""

from __future__ import annotations

DOCUMENTATION = r"""
module: undo
short_description: Put back what the last change of a CANopen bus replaced
description:
  - Runs C(dvtcli undo) on the host that has the bus.
  - Each run undoes one change more, so that it is no task for a playbook that runs every night.
  - It fails with exit code 2 if there is nothing to undo, and with 6 if somebody else has changed it since.
options:
  all:
    description: Undo every change that is remembered, on every node.
    type: bool
    default: false
  node:
    description: The node-ID whose last change is undone; left out, the last change of any node.
    type: int
  backup:
    description: Put an automatic backup back instead, V(newest) or that of a date and time such as V(2026-11-22T04:11).
    type: str
  force:
    description: Put back although somebody else has changed it since.
    type: bool
    default: false
extends_documentation_fragment:
  - dvtcli.canopen.program
attributes:
  check_mode:
    support: full
    description: Nothing is written.
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: Go back to the set-up before the last rollout
  dvtcli.canopen.undo:
    bus: {interface: socketcan, channel: can0}

- name: Put an automatic backup of a drive back
  dvtcli.canopen.undo:
    bus: {interface: socketcan, channel: can0}
    node: 5
    backup: 2026-11-22T04:11
"""

RETURN = r"""
writes:
  description: SDO downloads that were made; in check mode, that would be.
  type: int
  returned: success
exit_code:
  description: The exit code of dvtcli; 127 if it is not installed.
  type: int
  returned: always
retry:
  description: Whether the same task may succeed later, which is so of exit code 5 alone.
  type: bool
  returned: always
state:
  description: In which state the nodes are, C(unchanged), C(rolled_back), C(left_changed) or C(unknown).
  type: str
  returned: failure
"""

from ansible_collections.dvtcli.canopen.plugins.module_utils.dvtcli_command import DONE, Ended, dvtcli_module, flags


def main():
    """Undo, or say in check mode what would be."""
    module = dvtcli_module(
        all={"type": "bool", "default": False},
        node={"type": "int"},
        backup={"type": "str"},
        force={"type": "bool", "default": False},
    )
    asked = module.params
    node = [] if asked["node"] is None else ["-n", str(asked["node"])]
    backup = [] if asked["backup"] is None else ["--backup"]
    if backup and asked["backup"] != "newest":
        backup.append(asked["backup"])
    dry = ["--dry-run"] if module.check_mode else []
    words = [*node, "--yes", *flags(module, "force"), *dry, "undo", *flags(module, "all"), *backup]
    ended = Ended(module, words)
    ended.unless(DONE)
    writes = sum(result.get("writes", 0) for result in ended.results)
    ended.done(changed=writes > 0, writes=writes)


if __name__ == "__main__":
    main()
