"""What errors and findings say to do next is said in calls of this API, whichever room says it."""

from __future__ import annotations

import re

import pytest

import dvtcli
from dvtcli.cli.catalogue import command_names
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DvtcliError, State
from dvtcli.operations.api import python_hints
from dvtcli.operations.api.called_hints import called
from dvtcli.operations.api.hints import python_words
from dvtcli.operations.api.python_hints import hint_in_python, in_python
from tests.api.hints_of_the_product import all_hints, all_texts
from tests.sample import heavy

_NAMES = "|".join(map(re.escape, command_names()))
#: calls, and programs of a terminal
_CALL = re.compile(r"`?(?:(?:node|bus|dvtcli)\.[\w.]+(?:\([^`()]*\))+(?:\.\w+\([^`()]*\))?|dvtcli -*\w[^`]*)`?")
_OPTION = re.compile(r"(?<![\w-])--?[a-z][\w-]*|`")
#: a command with what is typed behind it
_TYPED = re.compile(rf"\b(?:{_NAMES})(?: [A-Z]{{3,}}\b| \d+\b| [tr]pdo\d| [\w-]+=| --)")
#: a command that does something, or that stands alone
_DONE = re.compile(
    rf"(?:^|[;:,] |\bor |\bthen )(?:{_NAMES})"
    r"(?: (?:shows?|finds|tells|takes|lists|listens|makes|searches|puts|goes)|[;:,]|$)"
)
#: words that are a command's, said as English, or typed in another program's window
_ENGLISH = re.compile(
    r"node 5|write 5 or 5/5|ssh -L|vendor-product\[-revision\]|or eds$|eds takes the path|bitrate 5|give dbc, eds,"
)


def not_a_call(hint: str) -> list[str]:
    """What of a *hint*, as a program is told it, is still typed at a command line."""
    left = _ENGLISH.sub("", _CALL.sub("", hint_in_python(hint)))
    return [found[0] for rule in (_OPTION, _TYPED, _DONE) for found in rule.finditer(left)]


def test_all_hints_are_found() -> None:
    assert len(all_hints()) > 250
    for hint in ("eds convert net.yaml net.dbc --with emcy", "nmt preop 5"):
        assert hint in all_hints()


def test_no_hint_is_a_command_line() -> None:
    wrong = {
        f"{place}: {hint_in_python(hint)}": said for hint, place in all_hints().items() if (said := not_a_call(hint))
    }
    assert not wrong


@pytest.mark.parametrize(
    "hint", ["frobnicate --nix", "read NAME", "`unknown TEXT`", "map 5 eds=x", "scan shows", "look at -x"]
)
def test_what_is_typed_is_noticed(hint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.api.test_hints.hint_in_python", str)
    assert not_a_call(hint)


@heavy
@pytest.mark.parametrize(("table", "begins"), [("_SENTENCES", ""), ("_ARGUMENTS", "--")])
def test_what_is_translated_is_said_somewhere(table: str, begins: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an entry some text of the product would come out otherwise."""
    stale = set()
    entries: dict[str, str] = getattr(python_hints, table)
    for entry in entries:
        concerned = {text: hint_in_python(text) for text in all_texts() if f"{begins}{entry}" in text}
        with monkeypatch.context() as without:
            without.setattr(python_hints, table, {key: value for key, value in entries.items() if key != entry})
            if all(hint_in_python(text) == said for text, said in concerned.items()):
                stale.add(entry)
    assert not stale, f"{table} of operations/api/python_hints.py: no text of the product needs these"


def test_a_command_in_marks_is_its_call_or_how_it_is_typed() -> None:
    marked = {found for text in all_texts() for found in re.findall(rf"`(?:{_NAMES})`", text)}
    assert len(marked) > 15
    left = {
        one for one in marked if not re.fullmatch(r"`(?:(?:node|bus|dvtcli)\.[\w.]+\(\)|dvtcli .+)`", in_python(one))
    }
    assert not left, "operations/api/python_hints.py: say what these are in a program"


SAID = {
    "no such PDO": (lambda node: node.map("tpdo9", "6041"), "`node.pdos()` lists what it has"),
    "no such object": (lambda node: node.read(0x9999), "`node.objects(TEXT)` searches the dictionary"),
    "nothing to map": (lambda node: node.map("tpdo1", "9999"), "`node.objects(TEXT)` searches the dictionary"),
    "no name": (
        lambda node: node.write("nonsense", 1),
        "`node.objects(TEXT)` searches the dictionary; eds=FILE gives one",
    ),
}


@pytest.mark.parametrize("case", SAID)
def test_an_error_says_which_call_helps(case: str) -> None:
    call, hint = SAID[case]
    with dvtcli.simulate("gen4") as bus, pytest.raises(DvtcliError) as raised:
        call(bus.node())
    said = getattr(raised.value, "findings", None)
    assert (said[0].hint if said else raised.value.hint) == hint


def test_a_period_of_nothing_is_refused() -> None:
    with dvtcli.simulate("gen4") as bus, pytest.raises(DvtcliError, match="period_ms=0: a number of milliseconds"):
        bus.sync(3, period_ms=0)


@pytest.mark.parametrize(
    ("state", "said", "note"),
    [
        ("left_changed", "LEFT CHANGED: see above; read it", "state: left_changed: read it"),
        ("unknown", "unknown: read it", "state: unknown: read it"),
        ("unknown", "nobody read it", "state: unknown: nobody read it"),
    ],
)
def test_a_state_is_said_once(state: State, said: str, note: str) -> None:
    failed = DvtcliError("what failed", state=state)
    failed.state_text = said
    with pytest.raises(DvtcliError) as raised, python_words():
        raise failed
    assert raised.value.__notes__ == [note]


@pytest.mark.parametrize("call", ["store", "restore"])
def test_a_store_whose_answer_went_with_the_bus_says_what_is_not_known(call: str) -> None:
    with dvtcli.simulate("gen4", faults=["bus-error@1"]) as bus, pytest.raises(BusUnavailable) as raised:
        getattr(bus.node(), call)(yes=True)
    assert raised.value.state == "unknown"
    assert str(raised.value.hint).endswith(f"; then `node.{call}()` again: whether it did is not known")


def test_what_takes_a_network_back_is_a_call_of_the_bus() -> None:
    hint = Hint(Action.FINISH_STORES, why="goes on with the stores")
    said = called(hint + Hint(Action.RECOVER_ALL, why=", {} puts every node back"))
    assert said == "`bus.finish_stores()` goes on with the stores, `bus.recover()` puts every node back"


def test_what_finishes_a_change_is_a_call() -> None:
    said = hint_in_python("scan finds it; then recover finishes it, from /x/journal.json")
    assert "`node.recover()` finishes it, from /x/journal.json" in said
