"""Write a network file of many nodes, each with four TPDOs and four RPDOs: `python many_nodes.py 64 > many.yaml`.

Each node hears the four TPDOs of the node before it. Try it with nodes of one process:
`dvtcli $(python many_nodes.py 64 --sim) plan many.yaml`.
"""

from __future__ import annotations

import sys

#: what a TPDO sends and the RPDO of the next node takes, of one length: objects that the generic family has
PAIRS = (("6041", "6040"), ("606C", "60FF"), ("6064", "607A"), ("6061", "6060"))


def network(count: int) -> str:
    """The network file, as text."""
    lines = ["defaults: {store: true}", "nodes:"]
    for node_id in range(1, count + 1):
        before = node_id - 1 or count
        lines += [f"  n{node_id}:", f"    node_id: {node_id}", "    tpdo:"]
        for number, (sent, _) in enumerate(PAIRS):
            keys = f"enabled: true, transmission: 254, event_timer: {100 + number}, mapping: [{sent}]"
            lines.append(f"      {number + 1}: {{cob_id: 0x{can_id(node_id, number):X}, {keys}}}")
        lines.append("    rpdo:")
        for number, (_, taken) in enumerate(PAIRS):
            keys = f"enabled: {str(count > 1).lower()}, transmission: 255, mapping: [{taken}]"
            lines.append(f"      {number + 1}: {{cob_id: 0x{can_id(before, number):X}, {keys}}}")
    return "\n".join(lines) + "\n"


def can_id(node_id: int, number: int) -> int:
    """The CAN-ID of a node's TPDO, its *number* from 0: those of the predefined connection set."""
    return 0x180 + 0x100 * number + node_id


if __name__ == "__main__":
    nodes = int(sys.argv[1])
    options = " ".join(f"--sim generic@{node_id}" for node_id in range(1, nodes + 1))
    sys.stdout.write(f"{options}\n" if sys.argv[2:] == ["--sim"] else network(nodes))
