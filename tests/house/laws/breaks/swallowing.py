"""Ways to lose an error (law 7)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break, in_a_function

BREAKS = [
    Break("swallowing", "device/node.py", in_a_function("try:", "    node()", "except DvtcliError:", "    _ = 1")),
    Break("swallowing", "cli/commands/map.py", in_a_function("try:", "    node()", "except Exception as e:", "    e")),
    Break("swallowing", "device/node.py", in_a_function("try:", "    node()", "except:", "    pass")),
    Break("swallowing", "files/dbc.py", in_a_function("try:", "    node()", "except (OSError, BaseException): ...")),
    Break("swallowing", "files/dbc.py", in_a_function("with contextlib.suppress(Exception):", "    node()")),
    Break("swallowing", "device/node.py", in_a_function("try:", "    node()", "except DvtcliError:", "    return 0")),
    Break("swallowing", "device/node.py", in_a_function("with suppress(DvtcliError):", "    node()")),
    Break(
        "swallowing",
        "device/node.py",
        in_a_function("try:", "    node()", "except Exception:", "    if node:", "        raise"),
    ),
    Break(
        "swallowing",
        "device/node.py",
        in_a_function("try:", "    node()", "except Exception as e:", "    return lambda: e.throw()"),
    ),
    Break(
        "swallowing",
        "device/node.py",
        "ALL = (OSError, Exception)\n" + in_a_function("try:", "    node()", "except ALL:", "    pass"),
    ),
    Break(
        "swallowing",
        "device/node.py",
        "from contextlib import suppress as quiet\n" + in_a_function("with quiet(Exception):", "    node()"),
    ),
    Break("swallowing", "device/node.py", "class Quiet:\n    def __exit__(self, *_):\n        return True"),
    Break("swallowing", "device/node.py", in_a_function("try:", "    node()", "except KeyboardInterrupt:", "    pass")),
    Break("swallowing", "device/node.py", in_a_function("sys.excepthook = node")),
    Break("swallowing", "device/node.py", "class Quiet:\n    __exit__ = lambda self, *a: True"),
]
