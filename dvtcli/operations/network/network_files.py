"""`plan`, `diff` and `apply` of a network file or a saved plan. Writes the plan's file."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import received_ids
from dvtcli.domain.hint import Action, Hint, plain_json, verbatim
from dvtcli.domain.network.network_plan import NetworkPlan
from dvtcli.domain.text import all_nodes
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import is_about_device
from dvtcli.files.plan_file import is_network_plan, read_network_plan
from dvtcli.operations.changes.change import names, takes_store, understood
from dvtcli.operations.changes.possible_stores import refuse_impossible_stores
from dvtcli.operations.network.network_load import load_after
from dvtcli.operations.plans.judge_network import check_plans
from dvtcli.operations.plans.plan_network import checked_network, plan_network
from dvtcli.operations.plans.read_network_config import read_network_config, tell_unknown_bit_rate
from dvtcli.operations.results.networks import NetworkPlanned

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.device.node_parts import ReadableNode
    from dvtcli.domain.network.network_plan import NodePlan
    from dvtcli.domain.network.worst_case_load import WorstCaseLoad
    from dvtcli.operations.results.networks import NetworkApplied
    from dvtcli.operations.session.session import Session, SessionNodes

_GATEWAY_LINES = ".309"


def plan_file(
    session: Session,
    file: str,
    saved: str | None = None,
    *,
    tells: bool = False,
    trust_stamp: bool = False,
    include: tuple[str, ...] = (),
    manager: int | None = None,
) -> NetworkPlanned:
    """Show what must be written to bring nodes to the state of *file*; saves the plan as *saved* if given.

    *file* is a network file, a file about a device, or a saved plan, valid while its nodes are as when it was made.

    *tells* gives exit code 3 for differences; *trust_stamp* skips nodes whose stamp (0x1020) matches; *include* as of
    `DeviceOptions`, *manager* as of `plan_manager`. Raises as these and `plan_network`; but without *saved*, objects
    that devices lack are listed in the result, and the rest is planned.
    """

    def read() -> tuple[NetworkPlan, WorstCaseLoad | None]:
        plan = _plan_of(
            session, file, trust_stamp=trust_stamp, include=include, manager=manager, lists_missing=saved is None
        )
        return plan, None if manager is not None or plan.lacking else load_after(session, plan)

    plan, need = session.read_together(read)
    guards = {node.node_id: session.node(node.node_id).guard for node in plan.nodes}
    interrupted = (node_id for node_id, guard in guards.items() if guard is not None and guard.unfinished_journal())
    answer = NetworkPlanned(plan, tells, saved or "", need, tuple(interrupted))
    if saved is not None:
        from dvtcli.operations.session.save_script import make_file

        read_back = None if saved.lower().endswith(_GATEWAY_LINES) else read_network_plan
        make_file(session, Path(saved), _saved_text(session, answer, saved), read_back)
    return answer


def _saved_text(session: SessionNodes, answer: NetworkPlanned, saved: str) -> str:
    """Format the plan for the file *saved*, by its suffix."""
    if saved.lower().endswith(_GATEWAY_LINES):
        from dvtcli.operations.gateway.session_as_lines import plan_as_lines

        return plan_as_lines(session, answer.plan)
    return json.dumps(answer.document(), indent=1, default=plain_json) + "\n"


def apply_file(
    session: Session,
    file: str,
    *,
    prove: str | None = None,
    trust_stamp: bool = False,
    include: tuple[str, ...] = (),
    manager: int | None = None,
    on_plan: Callable[[NetworkPlan], None] = lambda _plan: None,
) -> NetworkApplied:
    """Bring nodes to the state of *file*: a network file, a file about a device, a saved plan.

    *on_plan* gets the plan first. *trust_stamp* skips nodes whose stamp (0x1020) matches; *include* as of
    `DeviceOptions`, *manager* as of `plan_manager`; UsageError if given with a saved plan. Raises as these,
    `plan_network` and `apply_network`.
    """
    from dvtcli.operations.plans.apply_network import apply_network

    if trust_stamp and prove is not None:
        raise UsageError(
            "give only one of them: values that are not read are not proved", given={"trust_stamp": True, "prove": None}
        )
    plan = _plan_of(session, file, trust_stamp=trust_stamp, include=include, manager=manager)
    on_plan(plan)
    applied_now = apply_network(session, plan, prove=prove)
    if prove is not None:
        _tell_unproved(session, plan)
    return applied_now


def _tell_unproved(session: SessionNodes, plan: NetworkPlan) -> None:
    """Report nodes of *plan* whose stored values were to be proved and are not."""
    left = [node.node_id for node in plan.nodes if not (node.store or node.is_asked_nothing)]
    unasked = [node_id for node_id in left if takes_store(session.node(node_id))]
    unable = [node_id for node_id in left if node_id not in unasked]
    if not any(node.store for node in plan.nodes):
        words = (
            f"nothing is proved: {verbatim(plan.file)} stores on no node (`store: true`), and {{}} proves stores only"
        )
        how = Hint(Action.GIVE, {"prove": True}, words)
        if unasked:
            how += Hint(Action.PROVE_STORE, {"node": unasked}, "{} stores and proves")
        session.reporter.warning(how + f"{all_nodes(unable)} cannot store (0x1010)" if unable else how)
        return
    if unable:
        session.reporter.note(f"{all_nodes(unable)} cannot store (0x1010), so nothing is proved")
    again = [node.node_id for node in plan.nodes if node.store and not node.stores]
    for ids, why in (
        (unasked, ": no `store: true`, so nothing is proved; {} stores and proves"),
        (again, " stored nothing now, so the stored values are not proved; {} proves them"),
    ):
        if ids:
            words = f"{all_nodes(ids)}{why}"
            session.reporter.note(Hint(Action.PROVE_STORE, {"node": ids}, words))


def may_store(file: str) -> bool:
    """Tell whether *file*, a network file or a saved plan, has a store, or does not exist yet."""
    if is_about_device(file):
        return False
    try:
        if is_network_plan(Path(file)):
            return any(node.stores for node in read_network_plan(Path(file)).nodes)
        return any(node.store for node in read_network_config(file).nodes)
    except OSError:
        return True
    except InputFileError:
        return False  # nothing of it is carried out


def _new_plan(
    session: Session,
    file: str,
    *,
    trust_stamp: bool,
    include: tuple[str, ...],
    manager: int | None,
    lists_missing: bool,
) -> NetworkPlan:
    """Plan *file* by its suffix; raises UsageError for options of the other kind of file."""
    if manager is not None:
        from dvtcli.operations.network.concise_network import plan_manager

        if trust_stamp or include or is_about_device(file):
            raise UsageError(
                "a manager gets a complete network file: no other file, and not its stamps or single objects",
                given={"to_manager": manager},
            )
        return plan_manager(session, file, manager)
    if not is_about_device(file):
        if include:
            raise UsageError(
                "select objects of a DCF, an XDC or a backup only; a network file lists its objects itself",
                given={"include": None},
            )
        return plan_network(session, file, trust_stamp=trust_stamp, lists_missing=lists_missing)
    if trust_stamp:
        raise UsageError("only the nodes of a network file have a stamp", given={"trust_stamp": True})
    from dvtcli.operations.devices.plan_device import DeviceOptions, plan_device

    return plan_device(session, file, DeviceOptions(include))


def _plan_of(
    session: Session,
    file: str,
    *,
    trust_stamp: bool,
    include: tuple[str, ...],
    manager: int | None,
    lists_missing: bool = False,
) -> NetworkPlan:
    with _opened(file):
        is_saved = not is_about_device(file) and is_network_plan(Path(file))
        saved = read_network_plan(Path(file)) if is_saved else None
    if saved is None:
        return _new_plan(
            session, file, trust_stamp=trust_stamp, include=include, manager=manager, lists_missing=lists_missing
        )
    if manager is not None:
        raise UsageError(
            f"{file} is a saved plan, which already lists the values to write",
            hint=Hint(Action.PLAN) + Hint(Action.GIVE, {"to_manager": "NODE"}, " {} makes a plan"),
        )
    if include:
        raise UsageError(
            f"{file} is a saved plan, which already lists the values to write",
            hint=Hint(Action.PLAN) + Hint(Action.GIVE, {"include": "OBJECT"}, " {} makes a plan"),
        )
    if trust_stamp:
        raise UsageError(
            f"{file} is a saved plan, which already has the values that were read",
            hint=Hint(Action.PLAN) + Hint(Action.GIVE, {"trust_stamp": True}, " {} makes a plan"),
        )
    tell_unknown_bit_rate(session, len(saved.nodes))
    nodes = {node_plan.node_id: session.node(node_plan.node_id) for node_plan in saved.nodes}
    for node in saved.nodes:
        if not len(node.plan) and node.plan.changes:
            raise InputFileError(f"{file}: node {node.node_id} changes nothing", place=file)
    with received_ids(session.bus) as received:
        known = [_known(nodes[node_plan.node_id], node_plan) for node_plan in saved.nodes]
        refuse_impossible_stores(nodes, {node_plan.node_id: node_plan.store for node_plan in known})
        plan = replace(saved, nodes=tuple(check_plans(nodes, known, force=session.options.force)))
        return checked_network(
            session, plan, received, of_device=any(node_plan.needs_power_off for node_plan in plan.nodes)
        )


def _known(node: ReadableNode, planned: NodePlan) -> NodePlan:
    """Add data of *node* to *planned*; raises SafetyRefusal if the node differs from the plan's basis."""
    from dvtcli.operations.plans.apply_network import refuse_stale

    boot_ups = node.bus.boot_ups(node.node_id)
    node.read_anew()
    refuse_stale(node, planned, (*planned.plan.changes, *planned.holds))
    changes = planned.plan.changes
    words = names(node, changes), understood(node, changes)
    return replace(planned, title=node.title, names=words[0], understood=words[1], boot_ups=boot_ups)


@contextmanager
def _opened(file: str) -> Iterator[None]:
    try:
        yield
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
