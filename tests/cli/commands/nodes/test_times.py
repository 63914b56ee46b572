"""Times as people write them: `300ms`, `5s`, `2min`, or a number of seconds, with every command that takes one."""

from __future__ import annotations

import pytest

from tests.cli.commands.bench import Bench
from tests.harness.sample import heavy


@pytest.mark.parametrize(("text", "seconds"), [("20ms", 0.02), ("0.02", 0.02), ("2e-2", 0.02), (".02s", 0.02)])
def test_a_recording_ends_after_that_time(text: str, seconds: float) -> None:
    with Bench(in_real_time=True) as bench:
        ran = bench.run(f"log run.log --duration {text} --json")
    assert ran.code == 0, ran
    assert ran.document["seconds"] >= seconds


@pytest.mark.parametrize("line", ["log x.log --duration", "monitor --duration", "load line.yaml --for"])
@pytest.mark.parametrize("text", ["5h", "-1", "ms", "1e9s", "nan", "inf"])
def test_what_is_no_time_is_a_usage_error(line: str, text: str) -> None:
    with Bench() as bench:
        ran = bench.run(f"{line} {text}")
    assert ran.code == 2
    assert "not a time" in ran.stderr or "not within" in ran.stderr


@heavy
def test_nothing_is_a_time_only_where_it_means_not_to_listen() -> None:
    with Bench() as bench:
        assert bench.run("load --for 0ms").code == bench.run("load --for 0").code == 0
        assert bench.run("log x.log --duration 0").code == 2
