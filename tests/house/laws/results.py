"""Law 8 for results: each says its document and how it is shown, in its own file; nothing else has a list of them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from tests.house.draw import parsed
from tests.house.laws.source_tree import SourceTree

_ROOM = "operations/results/"
_FACE = f"{_ROOM}__init__.py"
#: what describes answers and is none
_ABOUT = f"{_ROOM}documents.py"
#: what makes a document that is no command's answer, with which
_MAY_MAKE = {"cli/view/error_lines.py": "failures"}


def results_say_all_of_themselves(tree: SourceTree) -> Iterator[str]:
    """An answer has a schema, an exit code, and says its lines or names a renderer that there is."""
    for file, module in tree:
        if file in (_FACE, _ABOUT, *_MAY_MAKE):
            continue
        if not file.startswith(_ROOM):
            yield from (f"{file}:{node.lineno} {node.name}: a result belongs to {_ROOM}" for node in _documents(module))
            continue
        above = {node.name: _members(node) for node in module.body if isinstance(node, ast.ClassDef)}
        answers = [node for node in module.body if isinstance(node, ast.ClassDef) and _is_answer(node)]
        for node in answers:
            yield from (
                f"{file}:{node.lineno} {node.name}: {what}" for what in _missing(tree, node, _with_bases(node, above))
            )


def _documents(module: ast.Module) -> list[ast.ClassDef | ast.FunctionDef]:
    """Classes whose document has a schema of ours, and functions that write one."""
    makers = [node for node in module.body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    return [
        node
        for node in makers
        if (isinstance(node, ast.FunctionDef) or "document" in _members(node)) and _schema(ast.unparse(node))
    ]


def _schema(source: str) -> bool:
    return re.search(r"('schema': |\bschema=)(f?'dvtcli\.|self\.)", source) is not None


def _is_answer(node: ast.ClassDef) -> bool:
    """Whether it says itself what it answers: a document, and an exit code, or by its base."""
    says = "document" in _members(node)
    return says and ("exit_code" in _members(node) or "renderer" in _members(node))


def _missing(tree: SourceTree, node: ast.ClassDef, members: set[str]) -> Iterator[str]:
    source = ast.unparse(node)
    if not _schema(source):
        yield 'its document has no schema, as {"schema": "dvtcli.NAME/1", …}'
    if "exit_code" not in members:
        yield "it says no exit code: a field `exit_code: int = 0`"
    said = re.search(r"renderer: ClassVar = '(\w+):(\w+)'", source)
    if said is None:
        if "text" not in members:
            yield "it says no text: a property `text` with its lines, or a `renderer` in cli/view/answers"
        return
    view = tree.texts.get(f"cli/view/answers/{said[1]}.py")
    functions = {} if view is None else {one.name: one for one in parsed(view).body if isinstance(one, ast.FunctionDef)}
    if said[2] not in functions:
        yield f"there is no {said[1]}:{said[2]} in cli/view/answers"
    elif len(functions[said[2]].args.args) != 2:
        yield f"{said[1]}:{said[2]} does not take (answer, width)"


def _members(node: ast.ClassDef) -> set[str]:
    names = {one.target.id for one in node.body if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)}
    return names | {one.name for one in node.body if isinstance(one, ast.FunctionDef)}


def _with_bases(node: ast.ClassDef, above: dict[str, set[str]]) -> set[str]:
    """What a class has itself, and by the bases that stand in its own file."""
    return _members(node).union(*(above.get(base.id, set()) for base in node.bases if isinstance(base, ast.Name)))
