"""Learning and profiles from Python: the answers and refusals of the commands `learn` and `profiles`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import dvtcli
from dvtcli.errors import SafetyRefusal, UsageError
from dvtcli.results import LearnForecast, LearntDevice
from tests.harness.sample import heavy


def held(node: dvtcli.Node) -> list[object]:
    """What every PDO of the node is set to."""
    return [row.config for row in node.pdos().rows]


@pytest.mark.long
def test_a_device_is_learnt_kept_and_put_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with dvtcli.simulate("generic", "tmcm@5") as bus:
        node = bus.node(5)
        before, others = held(node), held(bus.node(1))
        learnt = node.learn(save="pump", compare="gen4", yes=True)
        assert isinstance(learnt, LearntDevice)
        assert learnt.node == 5
        assert not learnt, "it is no Gen4"
        assert learnt.compared is not None
        assert {one.key for one in learnt.compared[1]}
        assert held(node) == before
        assert held(bus.node(1)) == others
    assert Path("pump/profile.toml").is_file()
    assert "pump" in [row.name for row in dvtcli.profiles() if row.own]


@heavy
def test_a_dry_run_says_what_would_be_asked_and_asks_nobody() -> None:
    with dvtcli.simulate("generic") as bus, bus.dry_run():
        forecast = bus.node().learn()
        assert isinstance(forecast, LearnForecast)
        assert 0 < forecast.likely <= forecast.writes
        assert forecast.document()["dry_run"]


def test_learning_needs_a_yes() -> None:
    with dvtcli.simulate("generic") as bus:
        before = held(bus.node())
        with pytest.raises(SafetyRefusal) as refused:
            bus.node().learn()
        assert refused.value.state == "unchanged"
        assert held(bus.node()) == before


@pytest.mark.parametrize(
    "wrong", [{"save": 5}, {"save": "Not A Name"}, {"compare": 7}, {"compare": "nosuch"}, {"isolated": "no"}], ids=str
)
def test_a_wrong_argument_is_named_before_anything_is_written(wrong: dict[str, Any]) -> None:
    with dvtcli.simulate("generic") as bus, pytest.raises(UsageError):
        bus.node().learn(**wrong, yes=True)


def test_profiles_are_listed_and_shown_with_their_reasons() -> None:
    names = [row.name for row in dvtcli.profiles()]
    assert len(dvtcli.profiles()) == len(names) > 5
    assert {"generic", "gen4"} <= set(names)
    shown = dvtcli.profile("espac")
    assert shown.like == "gen4"
    assert all(reason for _, _, reason in shown.values)


@pytest.mark.parametrize("name", ["nosuch", 5, None])
def test_a_profile_that_there_is_not_is_a_usage_error(name: Any) -> None:
    with pytest.raises(UsageError):
        dvtcli.profile(name)
