"""Ways to answer something that does not say all of itself (law 8)."""

from __future__ import annotations

from tests.house.laws.breaks.way import Break

#: a new result; what it says of itself is to be filled in
_ANSWER = """class Odd(Answer):
    {}
    exit_code: int = 0

    def document(self):
        return {{"schema": "dvtcli.odd/1"}}
"""

BREAKS = [
    Break(
        "results",
        "operations/changes/change.py",
        "class Odd:\n    def document(self):\n        return dict(schema='dvtcli.odd/1')",
    ),
    Break("results", "operations/results/values.py", _ANSWER.format("")),
    Break("results", "operations/results/nodes.py", _ANSWER.format("renderer: ClassVar = 'node_lines:no_such_lines'")),
    Break("results", "operations/results/pdos.py", _ANSWER.format("renderer: ClassVar = 'no_such_file:lines'")),
    Break(
        "results",
        "operations/results/facts.py",
        _ANSWER.format("renderer: ClassVar = 'node_lines:text_lines'").replace('"schema"', '"sort"'),
    ),
    Break("results", "operations/results/helper.py", _ANSWER.format("renderer: ClassVar = 'pdo_lines:text_lines'")),
    Break("results", "operations/results/helper.py", _ANSWER.format("texts: tuple[str, ...] = ()")),
    Break("results", "operations/changes/change.py", _ANSWER.format("renderer: ClassVar = 'node_lines:text_lines'")),
    Break(
        "results",
        "operations/results/nodes.py",
        _ANSWER.format("renderer: ClassVar = 'node_lines:text_lines'").replace("    exit_code: int = 0\n", ""),
    ),
    Break("results", "cli/commands/map.py", "def document():\n    return {'schema': 'dvtcli.odd/1'}"),
    Break("results", "operations/changes/change.py", "def odd():\n    return dict(schema='dvtcli.odd/1')"),
]
