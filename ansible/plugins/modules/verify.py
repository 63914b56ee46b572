#!/usr/bin/python
"""`verify` of a file against the nodes of a bus."""

from __future__ import annotations

DOCUMENTATION = r"""
module: verify
short_description: Compare CANopen nodes with a file
description:
  - Runs C(dvtcli verify) on the host that has the bus. No object is written; O(frame=true) commands the nodes.
  - The task fails with exit code 3 if anything differs.
options:
  file:
    description: A network file, DCF, XDC, backup, EDS or script, on the host.
    type: path
    required: true
  node:
    description: The node-ID, for a file that is about one device.
    type: int
  frame:
    description: Start the nodes (NMT), look at a frame of each enabled TPDO, and stop those again that were STOPPED.
    type: bool
    default: false
extends_documentation_fragment:
  - dvtcli.canopen.program
attributes:
  check_mode:
    support: full
    description: It only reads.
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: Is the traction chain still as traction.yaml says?
  dvtcli.canopen.verify:
    file: /etc/dvtcli/traction.yaml
    bus: {interface: socketcan, channel: can0}
"""

RETURN = r"""
document:
  description: What was compared, as C(dvtcli --json verify) says it.
  type: dict
  returned: always
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
    """Verify."""
    module = dvtcli_module(
        file={"type": "path", "required": True},
        node={"type": "int"},
        frame={"type": "bool", "default": False},
    )
    asked = module.params
    node = [] if asked["node"] is None else ["-n", str(asked["node"])]
    yes = ["--yes"] if asked["frame"] and not module.check_mode else []
    frame = flags(module, "frame") if not module.check_mode else []
    ended = Ended(module, [*node, *yes, "verify", asked["file"], *frame])
    ended.done(changed=False, document=ended.unless(DONE))


if __name__ == "__main__":
    main()
