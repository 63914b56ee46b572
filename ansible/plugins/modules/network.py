#!/usr/bin/python
"""`plan` and `apply` of a network file as one task that says what it changed."""

from __future__ import annotations

DOCUMENTATION = r"""
module: network
short_description: Make a CANopen network hold what a network file says, all or nothing
description:
  - Runs C(dvtcli plan) and, where something differs, C(dvtcli apply) on the host that has the bus.
  - In check mode nodes are read and nothing is written.
  - A fault on one node brings every node of the bus back to what it held; the task fails and says so.
  - A bus or a node that does not answer fails with exit code 5 and C(retry=true), so that C(retries), C(rescue),
    C(max_fail_percentage) and C(any_errors_fatal) see it.
  - A change that was interrupted before fails with exit code 6, also in check mode; M(dvtcli.canopen.recover)
    finishes it.
options:
  file:
    description: The network file, or a plan that C(dvtcli plan -o) saved, on the host.
    type: path
    required: true
  prove:
    description: Restart each node that stored, and compare what it comes up with.
    type: bool
    default: false
  force:
    description: Go on where dvtcli's rules refuse, or another master is heard.
    type: bool
    default: false
extends_documentation_fragment: dvtcli.canopen.program
attributes:
  check_mode: {support: full, description: Nodes are read and compared.}
  diff_mode: {support: full, description: Each parameter before and after.}
author:
  - The dvtcli developers (@dvtcli)
"""

EXAMPLES = r"""
- name: The traction chain is as traction.yaml says
  dvtcli.canopen.network:
    file: /etc/dvtcli/traction.yaml
    bus: {interface: socketcan, channel: can0}
    prove: true

- name: Rehearse it without a bus
  dvtcli.canopen.network:
    file: /etc/dvtcli/traction.yaml
    bus: {sim: [gen4@1, generic@5, generic@9]}
"""

RETURN = r"""
writes:
  description: SDO downloads that were made; in check mode, that would be.
  type: int
  returned: success
stored:
  description: The node-IDs that stored; in check mode, that would.
  type: list
  elements: int
  returned: success
nodes:
  description: The nodes of the file with what differed.
  type: list
  elements: dict
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

from ansible_collections.dvtcli.canopen.plugins.module_utils.dvtcli_command import (
    DIFFERS,
    DONE,
    REFUSED,
    Ended,
    changes,
    dvtcli_module,
    flags,
)

#: what a plan is carried out by, and of no use to who reads a task's result
_INNER = ("changes", "holds", "also_holds")


def main():
    """Plan; carry it out if something differs and this is no check."""
    module = dvtcli_module(
        file={"type": "path", "required": True},
        prove={"type": "bool", "default": False},
        force={"type": "bool", "default": False},
    )
    file, force = module.params["file"], flags(module, "force")
    if module.check_mode:
        ended = Ended(module, [*force, "plan", "--exit-code", file])
        document = ended.unless(DONE, DIFFERS)
        if document["interrupted"]:
            nodes = ", ".join(map(str, document["interrupted"]))
            why = f"an interrupted change of node {nodes} is not finished yet: apply would refuse; recover finishes it"
            ended.fail(why, "unchanged", code=REFUSED)
        stored = [node["node"] for node in document["nodes"] if node["store"] and (node["changes"] or node["unstored"])]
        changed = bool(document["changed"] or stored)
    else:
        ended = Ended(module, [*force, "--yes", "apply", *flags(module, "prove"), file])
        document = ended.unless(DONE)
        stored = [node["node"] for node in document["stored"]]
        changed = changes(document)
    ended.done(
        changed=changed,
        writes=document["writes"],
        stored=stored,
        nodes=[{key: value for key, value in node.items() if key not in _INNER} for node in document["nodes"]],
        diff=[{"before": text(document, 0), "after": text(document, 1)}],
    )


def text(document, side):
    """What nodes hold before (*side* 0) or after (1), a parameter a line."""
    lines = []
    for node in document["nodes"]:
        for pdo in node["pdos"]:
            pairs = ((key, value) for key, value in pdo.items() if isinstance(value, list) and len(value) == 2)
            lines += [f"node {node['node']} {pdo['pdo']} {key}: {_written(value[side])}" for key, value in pairs]
        for one in node["objects"]:
            lines.append(f"node {node['node']} {one['object']}: {one['after' if side else 'before']}")
    return "".join(line + "\n" for line in lines)


def _written(value):
    return " ".join(map(str, value)) if isinstance(value, list) else value


if __name__ == "__main__":
    main()
