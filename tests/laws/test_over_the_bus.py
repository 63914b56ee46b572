"""The laws once more through SDO frames, a python-can bus and a served node."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from dvtcli.device.read_pdos import present_pdos, read_pdo
from dvtcli.domain.plan import Plan, plan_pdo
from dvtcli.domain.rules import check_pdo, errors_in
from dvtcli.errors import DeviceRefused
from dvtcli.simulator.network.in_process_bus import simulate
from tests.laws.bench import (
    FAMILIES,
    NODE,
    FaultySdo,
    booted,
    dictionary,
    profile,
    proposal,
    refuse,
    transaction,
)
from tests.laws.configurations import legal


@pytest.mark.parametrize("family", FAMILIES)
@settings(
    max_examples=max(3, settings().max_examples // 12), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
@given(data=st.data())
def test_planned_or_as_it_was(family: str, data: st.DataObject) -> None:
    bus = simulate([booted(family)])
    try:
        sdo = bus.sdo(NODE)
        pdo = data.draw(st.sampled_from(present_pdos(sdo, dictionary(family))))
        now = read_pdo(sdo, pdo)
        want = data.draw(legal(family, pdo, now))
        assume(not errors_in(check_pdo(proposal(pdo, now, want, dictionary(family), profile(family)))))
        plan = Plan(NODE, (plan_pdo(pdo, now, want),))
        assume(len(plan))
        with pytest.raises(DeviceRefused):
            transaction(FaultySdo(sdo, refuse, data.draw(st.integers(1, len(plan)))), plan, clock=bus).run()
        assert read_pdo(sdo, pdo) == now
        transaction(sdo, plan, clock=bus).run()
        assert read_pdo(sdo, pdo) == want
    finally:
        bus.close()
