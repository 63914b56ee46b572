#!/usr/bin/python
"""`store` of nodes."""

from __future__ import annotations

DOCUMENTATION = r"""
module: store
short_description: Let CANopen nodes store their parameters (0x1010)
description:
  - Runs C(dvtcli store) on the host that has the bus, for one node after the other.
  - Each run stores anew. M(dvtcli.canopen.network) stores only what differs, if the network file says C(store),
    and spares the EEPROM of nodes in a playbook that runs every night.
options:
  nodes:
    description: The node-IDs.
    type: list
    elements: int
    required: true
  group:
    description: What is stored, V(all), V(communication), V(application) or a sub-index of 0x1010.
    type: str
    default: all
  prove:
    description: Restart each node, and compare what it comes up with.
    type: bool
    default: false
  force:
    description: Store although what was set no longer reads back.
    type: bool
    default: false
extends_documentation_fragment:
  - dvtcli.canopen.program
attributes:
  check_mode:
    support: full
    description: Nothing is stored; it is said what would be.
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: Keep what was set
  dvtcli.canopen.store:
    bus: {interface: socketcan, channel: can0}
    nodes: [1, 5]
    prove: true
"""

RETURN = r"""
stored:
  description: The node-IDs that stored.
  type: list
  elements: int
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
    """Store, or say in check mode which nodes would."""
    module = dvtcli_module(
        nodes={"type": "list", "elements": "int", "required": True},
        group={"type": "str", "default": "all"},
        prove={"type": "bool", "default": False},
        force={"type": "bool", "default": False},
    )
    asked = module.params
    dry = ["--dry-run"] if module.check_mode else []
    before = ["-n", ",".join(map(str, asked["nodes"])), "--yes", *flags(module, "force"), *dry]
    ended = Ended(module, [*before, "store", asked["group"], *flags(module, "prove")])
    ended.unless(DONE)
    stored = [result["node"] for result in ended.results if not result["skipped"]]
    ended.done(changed=bool(stored), stored=stored)


if __name__ == "__main__":
    main()
