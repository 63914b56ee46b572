"""Ways to ask for a maker instead of a behaviour (law 5)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("vendors", "device/node.py", in_a_function('if node.profile.name == "gen4":', "    return 1")),
    Break(
        "vendors",
        "device/store/store_parameters.py",
        in_a_function("if node.identity()['vendor'] == 0x1E:", "    return 1"),
    ),
    Break("vendors", "operations/changes/change.py", "VENDOR = 0x4349"),
    Break("vendors", "domain/plan.py", "class TrinamicPlan: ..."),
    Break("vendors", "cli/view/answers/pdo_lines.py", in_a_function("return session.curtis_order")),
    Break("vendors", "domain/cob_id.py", 'MAKERS = {"Lely": 1}'),
    Break("vendors", "bus/opening.py", "PRODUCT = 0x07050000"),
    Break("vendors", "device/node.py", in_a_function("if node.vendor_id == 30:", "    return 1")),
    Break("vendors", "device/node.py", "VENDOR_ID = 0x1E"),
    Break("vendors", "device/node.py", "_FIRST = 0x1E\n" + in_a_function("return node.vendor_id == _FIRST")),
    Break("vendors", "device/node.py", in_a_function("return {30: node}[node.vendor_id]")),
    Break("vendors", "device/node.py", "_FAST = {0x1E: 1.0}\n" + in_a_function("return _FAST.get(node.identity)")),
    Break("vendors", "device/node.py", in_a_function("node.configure(vendor=30)")),
    Break("vendors", "device/node.py", in_a_function("match node.product:", "    case 30:", "        return 1")),
    Break("vendors", "device/node.py", in_a_function('return node.name.startswith(b"Gen4")')),
    Break("vendors", "device/node.py", in_a_function('return node.name == "rob" + "oteq"')),
    Break("vendors", "device/node.py", in_a_function('return node.name == f"gen{4}"')),
    Break("vendors", "device/node.py", in_a_function("node.configure(gen4=True)")),
    Break("vendors", "device/node.py", "def _odd(curtis: int) -> None: ..."),
    Break("vendors", "device/node.py", "import dvtcli.domain.plan as lely"),
    Break("vendors", "device/trinamic_order.py", "ORDER = 1"),
    Break("vendors", "device/node.py", in_a_function("return node.maker in {30: 1}")),
]
