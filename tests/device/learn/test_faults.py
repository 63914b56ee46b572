"""Whatever goes wrong while a device is asked leaves it as it was; what is learnt all the same is the same."""

from __future__ import annotations

from typing import Any

import pytest

from dvtcli.errors import DvtcliError
from tests.device.learn.cells import some
from tests.device.learn.test_learnt_families import dump
from tests.device.learn.virtual import own

#: exit codes: done, refused or restarted, silent; never "left changed", never a bug
FINE = (0, 1, 5)
FAULTS = {
    "refuse": "refuse@{k}=0x08000022",
    "lose-request": "lose-request@{k}",
    "lose-response": "lose-response@{k}",
    "reset": "reset@{k}=0.05",
    "late": "late@{k}=0.3",
}


def learnt(ran_document: dict[str, Any]) -> dict[str, Any]:
    rows = [*ran_document["profile"], *ran_document["family"]]
    return {row["key"]: row["value"] for row in rows}


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, Any]:
    with own("tmcm") as bench:
        return learnt(bench.run("learn --yes --json").document)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    some(metafunc, "fault,step", [(fault, step) for fault in FAULTS for step in (1, 3, 8, 30, 75, 140, 200)], 2)


@pytest.mark.counted
def test_nothing_is_left_behind(fault: str, step: int, undisturbed: dict[str, Any]) -> None:
    with own("tmcm") as clean:
        before = dump(clean)
    with own("tmcm", {"fault": (FAULTS[fault].format(k=step),)}) as bench:
        ran = bench.run("learn --yes --json")
        assert ran.code in FINE, ran
        if ran.code:
            assert ran.document["state"] == "rolled_back", ran
        else:
            found = learnt(ran.document)
            assert {key: undisturbed[key] for key in found} == found
        assert dump(bench) == before


def test_a_device_that_falls_silent_for_good_is_left_changed_and_says_so() -> None:
    with own("tmcm", {"fault": ("silent@60",)}) as bench:
        ran = bench.run("learn --yes --json")
        assert (ran.code, ran.document["state"]) == (7, "left_changed"), ran


def test_dump_notices(undisturbed: dict[str, Any]) -> None:
    """The comparison would find a change."""
    assert undisturbed
    with own("tmcm") as bench:
        before = dump(bench)
        assert bench.run("set tpdo1 --timer 77").code == 0
        assert dump(bench) != before
        with pytest.raises(DvtcliError):
            bench.session.node().sdo.upload(0x5FFE, 0)
