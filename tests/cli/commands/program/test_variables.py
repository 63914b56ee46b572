"""A wrong value from an environment variable is blamed on the variable, and an unknown variable is named."""

from __future__ import annotations

import pytest

from tests.process import dvtcli, environment, run

SIMULATED = ("--sim", "gen4", "read", "6041")


@pytest.mark.parametrize(
    ("variable", "value"),
    [("TIMEOUT", "-1"), ("NODE", "abc"), ("COLOR", "blue"), ("BITRATE", "x"), ("BUS_SHARE", "200"), ("FORMAT", "text2"),
     ("MODULES", "x"), ("BUS_KWARGS", "x")],
)  # fmt: skip
def test_a_wrong_value_is_blamed_on_its_variable(variable: str, value: str) -> None:
    done = run(SIMULATED, env={**environment(), f"DVTCLI_{variable}": value})
    assert (done.returncode, done.stderr.startswith(f"error: DVTCLI_{variable}: ")) == (2, True), done.stderr
    option = f"--{variable.lower().replace('_', '-')}"
    typed = dvtcli(option, value, *SIMULATED)
    assert (typed.returncode, "DVTCLI" in typed.stderr) == (2, False), typed.stderr


def test_an_unknown_variable_is_named() -> None:
    done = run(SIMULATED, env={**environment(), "DVTCLI_TIMOUT": "3", "DVTCLI_TIMEOUT": "3"})
    assert done.returncode == 0
    assert done.stderr == "note: DVTCLI_TIMOUT means nothing to dvtcli; did you mean DVTCLI_TIMEOUT?\n"
    assert not run(("--quiet", *SIMULATED), env={**environment(), "DVTCLI_TIMOUT": "3"}).stderr
    assert not run(SIMULATED, env={**environment(), "DVTCLI_CONFIG": "", "DVTCLI_PASSCODE": "1"}).stderr
