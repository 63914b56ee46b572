#!/usr/bin/python
"""`backup` of a node to a file of the host."""

from __future__ import annotations

DOCUMENTATION = r"""
module: backup
short_description: Keep what a CANopen node holds in a file
description:
  - Runs C(dvtcli backup) on the host that has the bus. Nothing is written to the node.
  - The file is replaced only if the node holds something else than it says.
  - M(ansible.builtin.fetch) brings it to the controller.
options:
  node:
    description: The node-ID.
    type: int
    required: true
  dest:
    description: The file, on the host. Its suffix says what is written, C(.dcf), C(.xdc) or C(.jsonl).
    type: path
    required: true
  twice:
    description: Read each object twice, and leave out values that changed between the reads.
    type: bool
    default: false
extends_documentation_fragment:
  - dvtcli.canopen.program
attributes:
  check_mode:
    support: full
    description: The node is read and compared with the file, which is not changed.
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: Keep what the drive holds
  dvtcli.canopen.backup:
    bus: {interface: socketcan, channel: can0}
    node: 5
    dest: /var/backups/drive.dcf
    twice: true
"""

RETURN = r"""
file:
  description: The file.
  type: str
  returned: success
objects:
  description: How many objects were read.
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

import tempfile
from pathlib import Path

from ansible_collections.dvtcli.canopen.plugins.module_utils.dvtcli_command import (
    DIFFERS,
    DONE,
    Ended,
    dvtcli_module,
    flags,
    refuse,
)


def main():
    """Read the node; replace the file if it says something else."""
    module = dvtcli_module(
        node={"type": "int", "required": True},
        dest={"type": "path", "required": True},
        twice={"type": "bool", "default": False},
    )
    asked = module.params
    dest = asked["dest"]
    if not Path(dest).parent.is_dir():
        refuse(module, f"the folder of {dest} is not there")
    if Path(dest).is_dir():
        refuse(module, f"{dest} is a folder; name a file in it")
    made = str(Path(tempfile.mkdtemp(dir=module.tmpdir)) / Path(dest).name)
    ended = Ended(module, ["-n", str(asked["node"]), "--yes", "backup", made, *flags(module, "twice")], (made, dest))
    document = ended.unless(DONE)
    changed = True
    if Path(dest).exists():
        compared = Ended(module, ["compare", dest, made], (made, dest))
        result = compared.unless(DONE, DIFFERS)
        # identity, and settings that one of the files lacks, are no difference to `compare`
        changed = compared.code == DIFFERS or bool(result["about"] or result["unsaid"] or result["unlike"])
    if changed and not module.check_mode:
        module.atomic_move(made, dest)
    ended.done(changed=changed, file=dest, objects=document["objects"])


if __name__ == "__main__":
    main()
