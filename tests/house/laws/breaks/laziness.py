"""Ways to load or open something before it is needed (law 6)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break

BREAKS = [
    Break("laziness", "cli/registry.py", "import tkinter"),
    Break("laziness", "cli/main.py", "import can"),
    Break("laziness", "cli/registry.py", "import asyncio"),
    Break("laziness", "operations/session/session.py", "from dvtcli.bus.python_can import CanBus"),
    Break("laziness", "errors.py", "try:\n    import canopen\nexcept ImportError:\n    canopen = None"),
    Break("laziness", "__init__.py", "from dvtcli.operations.api.python_bus import simulate"),
    Break("laziness", "cli/main.py", '_CAN = importlib.import_module("can")'),
    Break("laziness", "cli/main.py", "import jinja2"),
    Break("laziness", "cli/main.py", "match 1:\n    case 1:\n        import asyncio"),
    Break("laziness", "cli/main.py", "if not TYPE_CHECKING:\n    import asyncio"),
    Break("laziness", "cli/main.py", "_LATER = lambda module=__import__('can'): module"),
    Break("laziness", "cli/commands/log.py", "import asyncio"),
    Break("laziness", "cli/registry.py", "_TEXT = Path(__file__).read_text()"),
    Break("laziness", "domain/datatypes.py", 'class Table:\n    rows = json.loads("[]")'),
    Break("laziness", "operations/session/session.py", "from dvtcli.simulator.network import hub"),
    Break("laziness", "cli/registry.py", "def _t():\n    return open(__file__).read()\nT = _t()"),
]
