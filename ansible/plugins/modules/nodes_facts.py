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
  - the authors of dvtcli
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
"""

from ansible.module_utils.basic import AnsibleModule
from ansible_collections.dvtcli.canopen.plugins.module_utils.dvtcli_command import ARGUMENTS, DONE, Ended


def main():
    """Scan."""
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True)
    document = Ended(module, ["scan"]).unless(DONE)
    module.exit_json(changed=False, ansible_facts={"canopen_nodes": document["nodes"]})


if __name__ == "__main__":
    main()
