"""Whatever is handed over for any argument of any public call: only errors that are documented come out."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

import dvtcli
from dvtcli import testing
from dvtcli.errors import Bug, DvtcliError, UsageError

#: what is no sensible value of most arguments
ODD: tuple[Any, ...] = (
    None, True, 0, -1, 10**30, 0.0015, float("nan"), "", "\0", "x", "tpdo999", b"x", [], [None], (), (1,) * 5, {},
    {1: None}, object(),
)  # fmt: skip
#: what stands for an argument that has no default, by its name
NEEDED: dict[str, Any] = {
    "file": "no.dcf", "target": "no.html", "recording": "no.log", "name": "gen4", "pdo": "tpdo1", "object_": 0x1017,
    "value": 0, "producer": "1:tpdo1", "command": "preop", "group": "digital-in", "pin": 1, "node_id": 1,
    "bit_rate": 250_000, "who": 5,
}  # fmt: skip
#: what a call is not left to take its time with
QUICK: dict[str, Any] = {"for_s": 0.001, "answer_s": 0.001, "wait_s": 0.005, "count": 1, "compare": "no"}
#: an option without which a call has nothing to do
USEFUL: dict[str, dict[str, Any]] = {"set": {"timer_ms": 100}}
#: `*objects` and the like, of which calls want one
SOME: dict[str, tuple[Any, ...]] = {
    "objects": ("6041",), "nodes": ("gen4",), "frames": ("185#10",), "consumers": ("1:rpdo1",), "pdos": ("tpdo1",),
    "files": ("no.dcf",),
}  # fmt: skip


def calls() -> Iterator[Any]:
    """Every public function and method, with every argument that it has."""
    owners = {"dvtcli": dvtcli, "Bus": dvtcli.Bus, "Node": dvtcli.Node, "Lss": dvtcli.Lss, "testing": testing}
    for owner, holder in owners.items():
        names = ["serve"] if owner == "testing" else dvtcli.__all__ if owner == "dvtcli" else dir(holder)
        for name in names:
            function = inspect.getattr_static(holder, name) if owner != "dvtcli" else getattr(dvtcli, name)
            if name.startswith("_") or not inspect.isfunction(function):
                continue
            for argument in inspect.signature(function).parameters:
                if argument != "self":
                    yield pytest.param(owner, name, argument, id=f"{owner}.{name}-{argument}")


@pytest.mark.drawn(20)
@pytest.mark.parametrize(("owner", "name", "argument"), list(calls()))
def test_only_documented_errors_come_out(
    owner: str, name: str, argument: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dvtcli_state: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    raised: list[DvtcliError] = []
    with dvtcli.simulate("gen4", timeout_s=0.05) as bus:
        holder: Any = {"dvtcli": dvtcli, "Bus": bus, "Node": bus.node(), "Lss": bus.lss, "testing": testing}[owner]
        for odd in ODD:
            with ExitStack() as opened:
                try:
                    answer = with_odd(getattr(holder, name), argument, odd)
                    if hasattr(answer, "__exit__"):
                        opened.enter_context(answer)
                except DvtcliError as error:
                    raised.append(error)
    assert [error for error in raised if isinstance(error, Bug) or not error.text] == []


def with_odd(function: Callable[..., Any], argument: str, odd: Any) -> Any:
    """What *function* answers where *argument* is *odd*, and all others are as they should be."""
    given: list[Any] = []
    named: dict[str, Any] = dict(USEFUL.get(function.__name__, {}))
    for name, one in inspect.signature(function).parameters.items():
        if one.kind is one.VAR_POSITIONAL:
            given += [odd] if name == argument else SOME.get(name, ())
        elif one.kind is one.VAR_KEYWORD:
            named |= dict.fromkeys(("timer_ms", "cob_id"), odd) if name == argument else {"timer_ms": 100}
        elif name == argument or one.default is one.empty or name in QUICK:
            value = odd if name == argument else NEEDED[name] if one.default is one.empty else QUICK[name]
            if one.kind is one.POSITIONAL_OR_KEYWORD and one.default is one.empty:
                given.append(value)
            else:
                named[name] = value
    return function(*given, **named)


def test_an_identity_is_complained_of_by_the_arguments_name() -> None:
    with dvtcli.simulate("gen4") as bus, pytest.raises(UsageError, match=r"^vendor_id="):
        bus.node().require(vendor_id="1")  # type: ignore[arg-type]
