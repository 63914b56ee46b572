"""What errors and findings say to do next is said in calls of this API, whichever room says it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import dvtcli
from dvtcli.cli.catalogue import command_names
from dvtcli.cli.view.typed_hints import error_text
from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import BusUnavailable, DvtcliError, RuleError, State, UsageError
from dvtcli.operations.api.called_hints import called, errors_in_calls
from tests.cli.commands.bench import Bench
from tests.operations.api.hints_of_the_product import all_hints

_NAMES = "|".join(map(re.escape, command_names()))
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
    r"store: (?:true|false)|node 5|write 5 or 5/5|ssh -L|vendor-product\[-revision\]|or eds$|eds takes"
)


def typed_words(hint: str) -> list[str]:
    """What of a *hint* that is text is typed at a command line."""
    left = _ENGLISH.sub("", hint)
    return [found[0] for rule in (_OPTION, _TYPED, _DONE) for found in rule.finditer(left)]


@pytest.mark.together
def test_all_hints_are_found() -> None:
    assert len(all_hints()) > 100
    for hint in ("give a name: 5", "check its supply, then try again"):
        assert hint in all_hints()


@pytest.mark.together
def test_a_hint_that_is_text_names_no_command_and_no_option() -> None:
    """These are a Hint, which the command line and this API write each in its way."""
    wrong = {f"{place}: {hint}": said for hint, place in all_hints().items() if (said := typed_words(hint))}
    assert not wrong


@pytest.mark.parametrize(
    "hint", ["frobnicate --nix", "read NAME", "`unknown TEXT`", "map 5 eds=x", "scan shows", "look at -x"]
)
def test_what_is_typed_is_noticed(hint: str) -> None:
    assert typed_words(hint)


@pytest.mark.parametrize(
    ("given", "called", "typed"),
    [
        ({"timeout_s": 5}, "timeout_s=5: wrong", "--timeout 5: wrong"),
        ({"services": None, "everything": None}, "services and everything: wrong", "--with and --all: wrong"),
        ({"trust_stamp": True, "prove": None}, "trust_stamp and prove: wrong", "--trust-stamp and --prove: wrong"),
        ({}, "wrong", "wrong"),
    ],
)
def test_what_was_given_wrongly_is_an_argument_here_and_an_option_there(
    given: dict[str, object], called: str, typed: str
) -> None:
    assert error_text(UsageError("wrong", given=given)) == typed
    with pytest.raises(UsageError) as raised, errors_in_calls(), errors_in_calls():
        raise UsageError("wrong", given=given)
    assert (raised.value.text, str(raised.value)) == (called, called)


@pytest.mark.parametrize(
    ("hint", "said"),
    [
        (Hint(Action.GIVE, {"prove": True}, "without {}"), "without prove=True"),
        (Hint(Action.GIVE, {"as_type": "os"}, "shows it"), "as_type='os' shows it"),
        (Hint(Action.GIVE, {"expect": "NUMBER"}, "says it"), "expect=NUMBER says it"),
        (Hint(Action.GIVE, {"heartbeat": False}, "leaves it"), "heartbeat=False leaves it"),
        (Hint(Action.RECOVER, {"accept": True}, "takes it"), "`dvtcli recover --accept` takes it"),
        (Hint(Action.LSS_STORE, {"of": "NODE"}, "or {}"), "or `bus.lss.store(NODE)`"),
        (Hint(Action.MAP, {"pdo": "tpdo1", "off": True}), "`node.map('tpdo1', OBJECT, enabled=False)`"),
        (
            Hint(Action.SET_PDO, {"pdo": "tpdo1", "cob_id": "0x191", "no_rtr": True}, "does it"),
            "`node.set('tpdo1', cob_id=0x191, rtr=False)` does it",
        ),
        (
            Hint(Action.SET_PDO, {"pdo": "tpdo1", "inhibit": 1.5, "extended": False}),
            "`node.set('tpdo1', inhibit_ms=1.5)`",
        ),
        (Hint(Action.SET_PDO, {"pdo": "tpdo1", "mpdo": "sam"}), "`dvtcli set PDO --mpdo KIND`"),
        (Hint(Action.SEND_SYNC, {"count": 100, "period": 20}), "`bus.sync(100, period_ms=20)`"),
    ],
)
def test_a_hint_is_a_call(hint: Hint, said: str) -> None:
    assert called(hint) == said


SAID = {
    "no such PDO": (lambda node: node.map("tpdo9", "6041"), "`node.pdos()` lists its PDOs"),
    "no such object": (lambda node: node.read(0x9999), "`node.objects(TEXT)` searches the dictionary"),
    "nothing to map": (lambda node: node.map("tpdo1", "9999"), "`node.objects(TEXT)` searches the dictionary"),
    "no name": (
        lambda node: node.write("nonsense", 1),
        "`node.objects(TEXT)` searches the dictionary; eds=FILE names the EDS",
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
    with pytest.raises(DvtcliError) as raised, errors_in_calls():
        raise failed
    assert raised.value.__notes__ == [note]


@pytest.mark.parametrize("call", ["store", "restore"])
def test_a_store_whose_answer_went_with_the_bus_says_what_is_not_known(call: str) -> None:
    with dvtcli.simulate("gen4", faults=["bus-error@1"]) as bus, pytest.raises(BusUnavailable) as raised:
        getattr(bus.node(), call)(yes=True)
    assert raised.value.state == "unknown"
    assert str(raised.value.hint).endswith(f"; then `node.{call}()` again: whether it did is not known")


def test_what_takes_a_network_back_is_a_call_of_the_bus() -> None:
    hint = Hint(Action.FINISH_STORES, why="continues with the stores")
    said = called(hint + Hint(Action.RECOVER_ALL, why=", {} puts every node back"))
    assert said == "`bus.finish_stores()` continues with the stores, `bus.recover()` puts every node back"


LINKS = (
    ("606C 606C", "5:rpdo4 60FF"),
    ("6041 6041 6041", "5:rpdo4 6072"),
    ("606C 606C", "6:rpdo2 60FF"),
)
#: gen4 and generic have dummies, tmcm has none
LINKED = ("gen4@1", "generic@5", "tmcm@6")


@pytest.mark.parametrize(("sent", "received"), LINKS)
@pytest.mark.parametrize("choice", [0, -1])
def test_the_hint_of_a_link_is_a_call_that_runs(sent: str, received: str, choice: int) -> None:
    consumer, *objects = received.split()
    with dvtcli.simulate(*LINKED) as bus:
        bus.node(1).map("tpdo1", *sent.split())
        bus.node(int(consumer[0])).map(consumer[2:], *objects, enabled=False)
        with pytest.raises(RuleError, match="could receive") as refused:
            bus.link("1:tpdo1", consumer)
        calls = re.findall(r"`(bus[.].*?)`", str(refused.value.findings[0].hint))
        assert eval(calls[choice], {"bus": bus})  # noqa: S307 - the product's words
        assert bus.link("1:tpdo1", consumer)


@pytest.mark.parametrize(("sent", "received"), LINKS)
@pytest.mark.parametrize("choice", [0, -1])
def test_the_hint_of_a_link_is_a_command_that_runs(sent: str, received: str, choice: int) -> None:
    with Bench(LINKED, {"yes": True}) as bench:
        assert bench.run(f"map 1:tpdo1 {sent}").code == 0
        assert bench.run(f"map {received} --off").code == 0
        refused = bench.run(f"link 1:tpdo1 {received[:7]}")
        assert refused.code == 1
        assert bench.run(re.findall(r"`dvtcli .*?(map .*?)`", refused.stderr)[choice]).code == 0
        assert bench.run(f"link 1:tpdo1 {received[:7]}").code == 0


def test_the_hints_of_a_checked_file_are_calls(tmp_path: Path) -> None:
    """A command among them would be typed elsewhere."""
    path = tmp_path / "net.yaml"
    path.write_text("a: {node_id: 1, dcf: gen4, tpdo: {1: {transmission: 1}}}\n")
    with dvtcli.simulate("gen4@1") as bus:
        report = bus.check(path).reports[0]
    assert [finding.hint for finding in report.findings if finding.hint]
    assert all(finding.hint is None or isinstance(finding.hint, str) for finding in report.findings)
