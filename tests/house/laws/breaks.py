"""Ways to break each law, at least three a law: a line put into a file, or a new file, that a check must notice."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Break:
    """*text* put behind the imports of *file*, or a new file; the check *law* must name that file."""

    law: str
    file: str
    text: str


def _function(*lines: str) -> str:
    return "\n".join(["def _broken(node, session, bus, ctx):", *(f"    {line}" for line in lines)])


def _for_types(line: str) -> str:
    return f"if TYPE_CHECKING:\n    {line}"


#: a new result; what it says of itself is to be filled in
_ANSWER = """class Odd(Answer):
    {}
    exit_code: int = 0

    def document(self):
        return {{"schema": "dvtcli.odd/1"}}
"""

BREAKS = [
    # 1: direction, of rooms and of the folders in a room
    Break("folders", "operations/helper.py", "A_NUMBER = 1"),
    Break("folders", "operations/user/said.py", _function("from dvtcli.operations.session.rehearse import Rehearse")),
    Break("folders", "operations/meanings/named_objects.py", _for_types("from dvtcli.operations import pdos")),
    Break("direction", "domain/plan.py", "from dvtcli.device.node import Node"),
    Break("direction", "operations/changes/change.py", _function("from dvtcli.cli.pdo_params import NodePdo")),
    Break("direction", "operations/changes/change.py", _for_types("from dvtcli.cli.view.output import Output")),
    Break("direction", "device/node.py", _function('return importlib.import_module("dvtcli.operations.sync")')),
    Break("direction", "files/dbc.py", _function('importlib.import_module(f"dvtcli.cli.commands.{node}")')),
    Break("direction", "bus/opening.py", _function('__import__("dvtcli.simulator.network.hub")')),
    Break("direction", "bus/opening.py", '_ARGV = ["-m", "dvtcli.cli.main"]'),
    Break("direction", "watch/table.py", _function("from dvtcli import connect")),
    Break("direction", "domain/cob_id.py", "from dvtcli.domain.plan import Plan"),
    Break("direction", "device/helper.py", "from dvtcli.files.dbc import read_dbc"),
    Break("direction", "device/node.py", _function('return importlib.import_module("." + "main", "dvtcli.cli")')),
    Break("direction", "device/node.py", '_KIND: "dvtcli.cli.view.output.Output | None" = None'),
    Break("direction", "device/node.py", _function("import dvtcli.domain.plan", "return dvtcli.cli.main.main()")),
    Break("direction", "bus/opening.py", _function('subprocess.run([sys.executable, "-m", "dvtcli", "scan"])')),
    Break("direction", "files/dbc.py", _function('import_module("dvtcli.cli.%s" % node)')),
    Break("direction", "files/dbc.py", _function('import_module(f"dvtcli.{node}.main")')),
    Break("direction", "domain/plan.py", _function("from .. import operations")),
    # 1: independence of the strict device
    Break("independence", "simulator/device/judge.py", "from dvtcli.domain import rules"),
    Break("independence", "simulator/device/memory.py", _function("from dvtcli.domain.plan import plan_pdo")),
    Break("independence", "simulator/device/limits.py", "if TYPE_CHECKING:\n    from dvtcli.domain import rules"),
    Break(
        "independence",
        "simulator/device/simulated_faults.py",
        _function('importlib.import_module("dvtcli.domain.rules")'),
    ),
    Break("independence", "simulator/device/gates.py", "import dvtcli.device.read_pdos"),
    Break("independence", "simulator/device/lss_slave.py", "from dvtcli.bus.discover import *"),
    Break("independence", "simulator/device/judge.py", "from dvtcli import domain"),
    Break("independence", "simulator/device/judge.py", "from dvtcli.domain.end_state import EndState"),
    Break("independence", "simulator/device/judge.py", _function('open("profile.toml")')),
    # libraries
    Break("libraries", "device/node.py", "import canopen"),
    Break("libraries", "operations/changes/change.py", _function("import click")),
    Break("libraries", "cli/commands/map.py", _function("from can import Bus")),
    Break("libraries", "domain/plan.py", "from ruamel.yaml import YAML"),
    Break("libraries", "watch/decoder.py", _function('return importlib.import_module("can.interfaces")')),
    Break("libraries", "cli/view/lines.py", "from prompt_toolkit.formatted_text import HTML"),
    Break("libraries", "device/node.py", _function("load = importlib.import_module", 'return load("canopen")')),
    Break("libraries", "device/node.py", _function('return sys.modules["can"]')),
    Break("libraries", "device/node.py", _function('__import__(name="can")')),
    Break("libraries", "device/node.py", _function('exec("import can")')),
    Break("libraries", "files/dbc.py", _function('import_module(__package__.partition(".")[0] + ".cli.main")')),
    Break("libraries", "cli/commands/map.py", "from dvtcli.bus.python_can import can"),
    Break("libraries", "cli/commands/map.py", "import rich"),
    Break("libraries", "files/pdo_yaml.py", _function("import requests")),
    Break("libraries", "operations/changes/change.py", _function("import cantools")),
    Break("libraries", "files/recording.py", _function("import socket", "socket.socket().sendto(b'', node)")),
    Break("libraries", "operations/helper.py", "from subprocess import run"),
    Break("libraries", "device/node.py", _function("import signal", "signal.signal(2, signal.SIG_IGN)")),
    Break("buses", "operations/changes/change.py", _function("return isinstance(node.bus, CanBus)")),
    Break("buses", "cli/commands/map.py", _function("from dvtcli.bus.python_can import CanBus as Real",
                                                    "return isinstance(node, (int, Real))")),
    Break("buses", "device/node.py", _function("return type(node.bus) is TwinBus")),
    Break("buses", "operations/api/python_bus.py", _function("return type(node).__name__ == 'InProcessBus'")),
    Break("buses", "watch/listener.py", _function("match node:", "    case FrameBus(): return 1")),
    Break("buses", "operations/doctor/doctor.py", _function("return hasattr(node.bus, 'tap')")),
    # 2: the plan is the only source of action
    Break("senders", "cli/commands/map.py", _function("node.sdo.download(0x1800, 1, b'')")),
    Break("senders", "operations/changes/change.py", _function("write = node.sdo.download", "write(0x1800, 1, b'')")),
    Break("senders", "cli/commands/pdo.py", _function("session.bus.send_nmt(1, 0)")),
    Break("senders", "watch/listener.py", _function("bus.send(node)")),
    Break("senders", "files/recording.py", _function("map(bus.send, node)")),
    Break("senders", "cli/dvt/sdo.py", _function('getattr(node.sdo, "download")(0x1017, 0, b"")')),
    Break("senders", "operations/helper.py", _function("bus.canopen().network.send_message(0, b'')")),
    Break("senders", "cli/commands/map.py", _function("vars(type(node.sdo))[node](0x1017, 0, b'')")),
    Break("senders", "cli/commands/map.py", _function("getattr(node.sdo, node.word)(0x1017, 0, b'')")),
    Break("senders", "operations/changes/change.py", _function("match node:", "    case Sdo(download=write):",
                                                              "        write(1)")),
    Break("senders", "operations/changes/change.py", "from dvtcli.device.change.transaction import Transaction"),
    Break("senders", "operations/pdos/helper.py", _function("from dvtcli.device import resets")),
    Break("senders", "cli/dvt/sdo.py", _function("import dvtcli.device.learn.asking")),
    Break("senders", "operations/helper.py", _function("session.canopen(1).nmt.state = 'OPERATIONAL'")),
    Break("senders", "operations/nodes/helper.py", "import dvtcli.device.store_parameters as keeping"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.store_parameters import *"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.store_parameters import sign as chosen"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device import store_parameters"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.operations.stores.store_restore import sign"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.operations.stores.store_restore import *"),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.operations.nodes.command_nmt import *"),
    Break("senders", "operations/nodes/helper.py", _function("from dvtcli.operations.nodes import command_nmt as one",
                                                               "one.send_reset(node)")),
    Break("senders", "operations/nodes/helper.py", "from dvtcli.device.seen_state import seen_state"),
    Break("senders", "operations/nodes/helper.py",
          _function('importlib.import_module("dvtcli.device.store_parameters").sign(node)')),
    Break("senders", "operations/nodes/helper.py",
          _function("import dvtcli.device.change.transaction", "dvtcli.device.store_parameters.sign(node)")),
    Break("senders", "cli/commands/map.py", _function("s = node.sdo", "getattr(s, node.word)(1)")),
    Break("senders", "cli/commands/map.py", _function("s: object = node.sdo", 'getattr(s, "down" + "load")(1)')),
    Break("senders", "cli/commands/map.py", _function("g = getattr", 'g(node.sdo, "download")(1)')),
    Break("senders", "cli/commands/map.py", _function("from operator import methodcaller as m",
                                                       'm("down" + "load", 1)(node.sdo)')),
    Break("senders", "cli/commands/map.py", _function('node.sdo.__class__.__dict__["down" + "load"](node.sdo, 1)')),
    Break("senders", "cli/commands/map.py", _function("dict(inspect.getmembers(node.sdo))[node](1)")),
    # 2 for commands: who only reads asks for nothing that sends
    Break("effects", "cli/commands/read.py", _function("from dvtcli.operations.stores import store_restore as it",
                                                       "it.store_settings(session)")),
    Break("effects", "cli/commands/scan.py", _function("from dvtcli.operations.nodes import command_nmt as it",
                                                        "it.command_nmt(session, 1)")),
    Break("effects", "cli/commands/objects.py", _function("import dvtcli.operations.changes.change as it",
                                                           "it.configure(session, node, {})")),
    Break("effects", "cli/commands/trace.py", _function("from dvtcli.operations.frames.send_frames import *")),
    Break("effects", "cli/commands/faults.py", _function("from dvtcli.operations.lss.lss_find import lss_scan")),
    # 5: behaviours, not vendors
    Break("vendors", "device/node.py", _function('if node.profile.name == "gen4":', "    return 1")),
    Break("vendors", "device/store_parameters.py", _function("if node.identity()['vendor'] == 0x1E:", "    return 1")),
    Break("vendors", "operations/changes/change.py", "VENDOR = 0x4349"),
    Break("vendors", "domain/plan.py", "class TrinamicPlan: ..."),
    Break("vendors", "cli/view/answers/pdo_lines.py", _function("return session.curtis_order")),
    Break("vendors", "domain/cob_id.py", 'MAKERS = {"Lely": 1}'),
    Break("vendors", "bus/opening.py", "PRODUCT = 0x07050000"),
    Break("vendors", "device/node.py", _function("if node.vendor_id == 30:", "    return 1")),
    Break("vendors", "device/node.py", "VENDOR_ID = 0x1E"),
    Break("vendors", "device/node.py", _function("node.configure(vendor=30)")),
    Break("vendors", "device/node.py", _function("match node.product:", "    case 30:", "        return 1")),
    Break("vendors", "device/node.py", _function('return node.name.startswith(b"Gen4")')),
    Break("vendors", "device/node.py", _function('return node.name == "rob" + "oteq"')),
    Break("vendors", "device/node.py", _function('return node.name == f"gen{4}"')),
    Break("vendors", "device/node.py", _function("node.configure(gen4=True)")),
    Break("vendors", "device/node.py", "def _odd(curtis: int) -> None: ..."),
    Break("vendors", "device/node.py", "import dvtcli.domain.plan as lely"),
    Break("vendors", "device/quirks/trinamic_order.py", "ORDER = 1"),
    # 6: nothing before it is needed
    Break("laziness", "cli/main.py", "import can"),
    Break("laziness", "cli/registry.py", "import asyncio"),
    Break("laziness", "operations/session/session.py", "from dvtcli.bus.python_can import CanBus"),
    Break("laziness", "errors.py", "try:\n    import canopen\nexcept ImportError:\n    canopen = None"),
    Break("laziness", "__init__.py", "from dvtcli.operations.api.open_bus import simulate"),
    Break("laziness", "cli/main.py", '_CAN = importlib.import_module("can")'),
    Break("laziness", "cli/main.py", "import jinja2"),
    Break("laziness", "cli/main.py", "match 1:\n    case 1:\n        import asyncio"),
    Break("laziness", "cli/main.py", "if not TYPE_CHECKING:\n    import asyncio"),
    Break("laziness", "cli/main.py", "_LATER = lambda module=__import__('can'): module"),
    Break("laziness", "cli/commands/log.py", "import asyncio"),
    Break("laziness", "cli/registry.py", "_TEXT = Path(__file__).read_text()"),
    Break("laziness", "domain/datatypes.py", 'class Table:\n    rows = json.loads("[]")'),
    Break("laziness", "operations/session/session.py", "from dvtcli.simulator.network import hub"),
    # 7: errors
    Break("exits", "cli/commands/map.py", _function("raise SystemExit(3)")),
    Break("exits", "operations/changes/change.py", _function("sys.exit(0)")),
    Break("exits", "cli/prompt/loop.py", "from sys import exit as leave"),
    Break("exits", "device/node.py", _function("raise SystemExit")),
    Break("exits", "files/dbc.py", _function("os._exit(0)")),
    Break("exits", "cli/scripts/script.py", _function("quit()")),
    Break("exits", "cli/commands/map.py", _function("ctx.exit(0)")),
    Break("exits", "cli/commands/map.py", _function("raise click.exceptions.Exit(0)")),
    Break("exits", "cli/commands/map.py", _function("raise click.Abort")),
    Break("exits", "device/node.py", _function("import sys as system", "system.exit(0)")),
    Break("exits", "device/node.py", _function("leave = sys.exit", "leave(0)")),
    Break("exits", "device/node.py", _function("error = SystemExit(0)", "raise error")),
    Break("exits", "device/node.py", _function("raise KeyboardInterrupt")),
    Break("exits", "device/node.py", _function("os.execv('/bin/true', [])")),
    Break("exits", "operations/changes/change.py", _function("atexit.register(node)")),
    Break("errors", "device/node.py", "class Odd(DvtcliError): ..."),
    Break("errors", "operations/helper.py", "class Odd(Exception): ..."),
    Break("errors", "cli/commands/map.py", "class MapError(click.ClickException): ..."),
    Break("errors", "files/dbc.py", "class Odd(InputFileError): ..."),
    Break("errors", "bus/opening.py", "class Odd(KeyboardInterrupt, object): ..."),
    Break("errors", "device/node.py", "Odd = type('Odd', (Exception,), {})"),
    Break("errors", "device/node.py", "Base = Exception\nclass Odd(Base): ..."),
    Break("errors", "device/node.py", "class Odd(StopIteration): ..."),
    Break("errors", "device/node.py", "from dvtcli.errors import NoAnswer as Silent\nclass Odd(Silent): ..."),
    Break("errors", "device/node.py", _function("raise RuntimeError('no')")),
    Break("swallowing", "cli/commands/map.py", _function("try:", "    node()", "except Exception as e:", "    e")),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "except:", "    pass")),
    Break("swallowing", "files/dbc.py", _function("try:", "    node()", "except (OSError, BaseException): ...")),
    Break("swallowing", "files/dbc.py", _function("with contextlib.suppress(Exception):", "    node()")),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "finally:", "    return 0")),
    Break("swallowing", "device/node.py", _function("for one in node:", "    try:", "        one()", "    finally:",
                                                    "        continue")),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "except DvtcliError:", "    return 0")),
    Break("swallowing", "device/node.py", _function("with suppress(DvtcliError):", "    node()")),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "except Exception:", "    if node:",
                                                    "        raise")),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "except Exception as e:",
                                                    "    return lambda: e.throw()")),
    Break("swallowing", "device/node.py", "ALL = (OSError, Exception)\n" + _function(
        "try:", "    node()", "except ALL:", "    pass")),
    Break("swallowing", "device/node.py", "from contextlib import suppress as quiet\n" + _function(
        "with quiet(Exception):", "    node()")),
    Break("swallowing", "device/node.py", "class Quiet:\n    def __exit__(self, *_):\n        return True"),
    Break("swallowing", "device/node.py", _function("try:", "    node()", "except KeyboardInterrupt:", "    pass")),
    Break("swallowing", "device/node.py", _function("sys.excepthook = node")),
    Break("printing", "operations/changes/change.py", _function('print("done")')),
    Break("printing", "cli/commands/map.py", _function("click.echo(1)")),
    Break("printing", "device/node.py", _function('sys.stderr.write("oops")')),
    Break("printing", "device/node.py", _function("map(print, node)")),
    Break("printing", "device/node.py", "from builtins import print as say\n" + _function("say(1)")),
    Break("printing", "device/node.py", _function("out = sys.stdout", "out.write('x')")),
    Break("printing", "device/node.py", _function("json.dump({}, sys.stdout)")),
    Break("printing", "device/node.py", _function("os.write(1, b'x')")),
    Break("printing", "device/node.py", _function('open("/dev/tty", "w").write("x")')),
    Break("printing", "device/node.py", _function("return input('sure? ')")),
    Break("printing", "device/node.py", _function("logging.warning('x')")),
    Break("printing", "cli/commands/map.py", _function("return click.confirm('sure?')")),
    Break("printing", "cli/commands/map.py", _function("session.output.stdout.write('x')")),
    # 8: said once
    Break("results", "operations/results/values.py", _ANSWER.format("")),
    Break("results", "operations/results/nodes.py", _ANSWER.format("renderer: ClassVar = 'node_lines:no_such_lines'")),
    Break("results", "operations/results/pdos.py", _ANSWER.format("renderer: ClassVar = 'no_such_file:lines'")),
    Break("results", "operations/results/files.py", _ANSWER.format("renderer: ClassVar = 'file_lines:file_lines'")
          .replace('"schema"', '"sort"')),
    Break("results", "operations/results/helper.py", _ANSWER.format("renderer: ClassVar = 'file_lines:file_lines'")),
    Break("results", "operations/results/helper.py", _ANSWER.format("texts: tuple[str, ...] = ()")),
    Break("results", "operations/changes/change.py", _ANSWER.format("renderer: ClassVar = 'file_lines:file_lines'")),
    Break("results", "operations/results/nodes.py", _ANSWER.format("renderer: ClassVar = 'file_lines:file_lines'")
          .replace("    exit_code: int = 0\n", "")),
]  # fmt: skip
