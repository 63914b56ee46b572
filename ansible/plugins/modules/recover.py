#!/usr/bin/python
"""`recover` of what was interrupted on a bus."""

from __future__ import annotations

DOCUMENTATION = r"""
module: recover
short_description: Finish changes of a CANopen bus that were interrupted
description:
  - Runs C(dvtcli recover) on the host that has the bus, for every node of which a change was interrupted.
  - Nothing is done, and the task is ok, if no change was interrupted.
  - In check mode it finds the hosts that were interrupted, and writes nothing.
options:
  how:
    description:
      - What becomes of the interrupted changes.
      - V(roll_back) puts back what the nodes held before.
      - V(finish) continues with the stores of a network whose nodes had all been verified.
      - V(accept) takes what the nodes hold as the new state.
      - V(discard) sets a journal that cannot be used aside.
    type: str
    choices: [roll_back, finish, accept, discard]
    default: roll_back
  force:
    description: Go on although the journal was made on another bus.
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
- name: Find what was interrupted
  dvtcli.canopen.recover:
    bus: {interface: socketcan, channel: can0}
  check_mode: true
  register: interrupted

- name: Put it back
  dvtcli.canopen.recover:
    bus: {interface: socketcan, channel: can0}
  when: interrupted is changed
"""

RETURN = r"""
nodes:
  description: The node-IDs of the interrupted changes.
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
    """Recover, or say in check mode what would be."""
    ways = ["roll_back", "finish", "accept", "discard"]
    module = dvtcli_module(
        how={"type": "str", "choices": ways, "default": "roll_back"},
        force={"type": "bool", "default": False},
    )
    how = module.params["how"]
    way = [] if how == "roll_back" else ["--" + how]
    dry = ["--dry-run"] if module.check_mode else []
    ended = Ended(module, ["--yes", *flags(module, "force"), *dry, "recover", *way])
    document = ended.unless(DONE)
    is_idle = document["schema"] == "dvtcli.recover/1" and document == {
        "schema": document["schema"],
        "node": document["node"],
        "recovered": False,
    }
    nodes = document.get("looked_at") or [node["node"] for node in document.get("nodes", [document])]
    ended.done(changed=not is_idle, nodes=[] if is_idle else nodes)


if __name__ == "__main__":
    main()
