"""Ways against the order of rooms and of folders, and around the strict device's independence (law 1)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, for_types, in_a_function

BREAKS = [
    Break("folders", "operations/helper.py", "A_NUMBER = 1"),
    Break(
        "folders",
        "operations/user/session_user.py",
        in_a_function("from dvtcli.operations.session.session import Rehearse"),
    ),
    Break("folders", "operations/values/named_objects.py", for_types("from dvtcli.operations import pdos")),
    Break("direction", "domain/plan.py", "from dvtcli.device.node import Node"),
    Break("direction", "operations/changes/change.py", in_a_function("from dvtcli.cli.object_params import NodePdo")),
    Break("direction", "operations/changes/change.py", for_types("from dvtcli.cli.view.output import Output")),
    Break("direction", "device/node.py", in_a_function('return importlib.import_module("dvtcli.operations.sync")')),
    Break("direction", "files/dbc.py", in_a_function('importlib.import_module(f"dvtcli.cli.commands.{node}")')),
    Break("direction", "bus/opening.py", in_a_function('__import__("dvtcli.simulator.network.hub")')),
    Break("direction", "bus/opening.py", '_ARGV = ["-m", "dvtcli.cli.main"]'),
    Break("direction", "watch/table.py", in_a_function("from dvtcli import connect")),
    Break("direction", "domain/cob_id.py", "from dvtcli.domain.plan import Plan"),
    Break("direction", "device/helper.py", "from dvtcli.files.dbc import read_dbc"),
    Break("direction", "device/node.py", in_a_function('return importlib.import_module("." + "main", "dvtcli.cli")')),
    Break("direction", "device/node.py", '_KIND: "dvtcli.cli.view.output.Output | None" = None'),
    Break("direction", "device/node.py", in_a_function("import dvtcli.domain.plan", "return dvtcli.cli.main.main()")),
    Break("direction", "bus/opening.py", in_a_function('subprocess.run([sys.executable, "-m", "dvtcli", "scan"])')),
    Break("direction", "files/dbc.py", in_a_function('import_module("dvtcli.cli.%s" % node)')),
    Break("direction", "files/dbc.py", in_a_function('import_module(f"dvtcli.{node}.main")')),
    Break("direction", "domain/plan.py", in_a_function("from .. import operations")),
    Break("independence", "simulator/device/strict_device.py", "from dvtcli.domain import rules"),
    Break("independence", "simulator/device/memory.py", in_a_function("from dvtcli.domain.plan import plan_pdo")),
    Break(
        "independence", "simulator/device/strict_device.py", "if TYPE_CHECKING:\n    from dvtcli.domain import rules"
    ),
    Break(
        "independence",
        "simulator/device/simulated_faults.py",
        in_a_function('importlib.import_module("dvtcli.domain.rules")'),
    ),
    Break("independence", "simulator/device/pdo_checks.py", "import dvtcli.device.read_pdos"),
    Break("independence", "simulator/device/lss_slave.py", "from dvtcli.bus.discover import *"),
    Break("independence", "simulator/device/strict_device.py", "from dvtcli import domain"),
    Break("independence", "simulator/device/strict_device.py", "from dvtcli.domain.script_line import EndState"),
    Break("independence", "simulator/device/strict_device.py", in_a_function('open("profile.toml")')),
    Break(
        "independence", "simulator/device/strict_device.py", in_a_function('return resources.files("dvtcli.families")')
    ),
    Break(
        "independence",
        "simulator/device/strict_device.py",
        in_a_function('return Path(__file__).parents[2] / "families"'),
    ),
]
