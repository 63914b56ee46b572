"""The words of a statusword, against the states of the simulated motor, which has a table of its own."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dvtcli.domain.process_data import drive_state
from dvtcli.simulator.device.plant import DriveState, state_of
from tests.process import dvtcli


@given(st.sampled_from(DriveState), st.integers(0, 0xFFFF))
def test_words_and_simulated_states_agree(state: DriveState, more: int) -> None:
    statusword = state | more & ~0x6F
    assert drive_state(statusword) == state.name.replace("_", " ").lower()
    assert state_of(statusword) is state


def test_read_says_the_state_of_a_drive() -> None:
    assert "= switch on disabled (0x0250)" in dvtcli("--sim", "gen4", "read", "statusword").stdout
    assert "enabled" not in dvtcli("--sim", "gen4", "read", "6040").stdout
