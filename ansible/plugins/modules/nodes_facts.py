#!/usr/bin/python
"""`scan` as facts of a host."""

from __future__ import annotations

DOCUMENTATION = r"""
module: nodes_facts
short_description: The nodes of a CANopen bus as facts
description:
  - Runs C(dvtcli scan) on the host that has the bus. Nothing is written.
options:
  bus:
    description: The bus, with the names of python-can. Left out, the host's own dvtcli.toml or environment chooses.
    type: dict
    default: {}
    suboptions:
      interface: {description: Interface of python-can, type: str}
      channel: {description: Its channel, type: str}
      bitrate: {description: Bit rate in bit/s, type: int}
      kwargs: {description: Further keys of the interface, type: dict, default: {}}
      sim: {description: Simulated nodes instead of a bus, type: list, elements: str, default: []}
  timeout:
    description: SDO time-out in seconds.
    type: float
  executable:
    description: The dvtcli to run.
    type: str
    default: dvtcli
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
