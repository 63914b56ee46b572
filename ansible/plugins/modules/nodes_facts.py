#!/usr/bin/python
"""`scan` as facts of a host."""

from __future__ import annotations

DOCUMENTATION = r"""
module: nodes_facts
short_description: The nodes of a CANopen bus as facts
description:
  - Runs C(dvtcli scan) on the host that has the bus. Nothing is written.
extends_documentation_fragment: dvtcli.canopen.program
attributes:
  check_mode: {support: full, description: It only reads.}
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: Who is there?
  dvtcli.canopen.nodes_facts:
    bus: {interface: socketcan, channel: can0}

- name: Drives of the second series only
  ansible.builtin.assert:
    that: canopen_nodes | selectattr('product_code', 'equalto', 0x0705302D) | length == 2
"""

RETURN = r"""
ansible_facts:
  description: C(canopen_nodes), a list with node, state, device_type, vendor_id, product_code, revision, serial, name.
  type: dict
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

from ansible_collections.dvtcli.canopen.plugins.module_utils.dvtcli_command import DONE, Ended, dvtcli_module


def main():
    """Scan."""
    ended = Ended(dvtcli_module(), ["scan"])
    ended.done(changed=False, ansible_facts={"canopen_nodes": ended.unless(DONE)["nodes"]})


if __name__ == "__main__":
    main()
