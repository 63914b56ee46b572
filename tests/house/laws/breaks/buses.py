"""Ways to ask a bus of which kind it is (law 1)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("buses", "operations/changes/change.py", in_a_function("return isinstance(node.bus, CanBus)")),
    Break(
        "buses",
        "cli/commands/map.py",
        in_a_function("from dvtcli.bus.python_can import CanBus as Real", "return isinstance(node, (int, Real))"),
    ),
    Break("buses", "device/node.py", in_a_function("return type(node.bus) is TwinBus")),
    Break("buses", "operations/api/python_bus.py", in_a_function("return type(node).__name__ == 'InProcessBus'")),
    Break("buses", "device/resets.py", in_a_function("match node:", "    case MessageBus(): return 1")),
    Break("buses", "operations/doctor/doctor.py", in_a_function("return hasattr(node.bus, 'tap')")),
    Break("buses", "operations/changes/change.py", in_a_function("return {CanBus: 1}[type(node.bus)]")),
    Break("buses", "operations/changes/change.py", in_a_function("return {CanBus: 1}.get(node.bus.__class__)")),
    Break("buses", "operations/changes/change.py", in_a_function("b = node.bus", 'return hasattr(b, "tap")')),
    Break("buses", "operations/changes/change.py", in_a_function('return "tap" in dir(node.bus)')),
    Break("buses", "operations/changes/change.py", "@go.register(TwinBus)\ndef _odd(bus): ..."),
    Break(
        "buses",
        "operations/changes/change.py",
        in_a_function("try:", "    return node.bus.channel_info", "except AttributeError:", "    return None"),
    ),
]
