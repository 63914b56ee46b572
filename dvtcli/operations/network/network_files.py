"""`plan`, `diff` and `apply` of a network file or a saved plan. Writes the plan's file."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.other_producers import received_ids
from dvtcli.domain.hint import Action, Hint, plain_json, verbatim
from dvtcli.domain.network.network_plan import NetworkPlan
from dvtcli.domain.text import all_nodes
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import is_about_device
from dvtcli.files.plan_file import is_network_plan, read_network_plan
from dvtcli.operations.changes.change import mapped_names, scaled_changes, takes_store
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
    from dvtcli.domain.store import ProveBy
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
        options = PlanOptions(trust_stamp, include, manager, lists_missing=saved is None)
        network_plan = _plan_of(session, file, options)
        return network_plan, None if manager is not None or network_plan.lacking else load_after(session, network_plan)

    network_plan, need = session.read_together(read)
    guards = {node_plan.node_id: session.node(node_plan.node_id).guard for node_plan in network_plan.nodes}
    interrupted = (node_id for node_id, guard in guards.items() if guard is not None and guard.unfinished_journal())
    answer = NetworkPlanned(network_plan, tells, saved or "", need, tuple(interrupted))
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
    prove: ProveBy | None = None,
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
    network_plan = _plan_of(session, file, PlanOptions(trust_stamp, include, manager))
    on_plan(network_plan)
    applied_now = apply_network(session, network_plan, prove=prove)
    if prove is not None:
        _tell_unproved(session, network_plan)
    return applied_now


def _tell_unproved(session: SessionNodes, network_plan: NetworkPlan) -> None:
    """Report nodes of *network_plan* whose stored values were to be proved and are not."""
    left = [
        node_plan.node_id for node_plan in network_plan.nodes if not (node_plan.store or node_plan.is_asked_nothing)
    ]
    unasked = [node_id for node_id in left if takes_store(session.node(node_id))]
    unable = [node_id for node_id in left if node_id not in unasked]
    if not any(node_plan.store for node_plan in network_plan.nodes):
        file = verbatim(network_plan.file)
        words = f"nothing is proved: {file} stores on no node (`store: true`), and {{}} proves stores only"
        how = Hint(Action.GIVE, {"prove": True}, words)
        if unasked:
            how += Hint(Action.PROVE_STORE, {"node": unasked}, "{} stores and proves")
        session.reporter.warning(how + f"{all_nodes(unable)} cannot store (0x1010)" if unable else how)
        return
    if unable:
        session.reporter.note(f"{all_nodes(unable)} cannot store (0x1010), so nothing is proved")
    again = [node_plan.node_id for node_plan in network_plan.nodes if node_plan.store and not node_plan.stores]
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


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options of `plan_file` and `apply_file`; with *lists_missing* the plan lists objects that devices lack."""

    trust_stamp: bool = False
    include: tuple[str, ...] = ()
    manager: int | None = None
    lists_missing: bool = False

    def refuse_with_saved(self, file: str) -> None:
        """Raises UsageError if an option is given that the saved plan *file* cannot have."""
        listed, read = "lists the values to write", "has the values that were read"
        for given, why, words in (
            (self.manager is not None, listed, {"to_manager": "NODE"}),
            (bool(self.include), listed, {"include": "OBJECT"}),
            (self.trust_stamp, read, {"trust_stamp": True}),
        ):
            if given:
                raise UsageError(
                    f"{file} is a saved plan, which already {why}",
                    hint=Hint(Action.PLAN) + Hint(Action.GIVE, words, " {} makes a plan"),
                )


def _new_plan(session: Session, file: str, options: PlanOptions) -> NetworkPlan:
    """Plan *file* by its suffix; raises UsageError for options of the other kind of file."""
    if options.manager is not None:
        from dvtcli.operations.network.concise_network import plan_manager

        if options.trust_stamp or options.include or is_about_device(file):
            raise UsageError(
                "a manager gets a complete network file: no other file, and not its stamps or single objects",
                given={"to_manager": options.manager},
            )
        return plan_manager(session, file, options.manager)
    if not is_about_device(file):
        if options.include:
            raise UsageError(
                "select objects of a DCF, an XDC or a backup only; a network file lists its objects itself",
                given={"include": None},
            )
        return plan_network(session, file, trust_stamp=options.trust_stamp, lists_missing=options.lists_missing)
    if options.trust_stamp:
        raise UsageError("only the nodes of a network file have a stamp", given={"trust_stamp": True})
    from dvtcli.operations.devices.plan_device import DeviceOptions, plan_device

    return plan_device(session, file, DeviceOptions(options.include))


def _plan_of(session: Session, file: str, options: PlanOptions) -> NetworkPlan:
    with _opened(file):
        is_saved = not is_about_device(file) and is_network_plan(Path(file))
        saved = read_network_plan(Path(file)) if is_saved else None
    if saved is None:
        return _new_plan(session, file, options)
    options.refuse_with_saved(file)
    tell_unknown_bit_rate(session, len(saved.nodes))
    nodes = {node_plan.node_id: session.node(node_plan.node_id) for node_plan in saved.nodes}
    for node_plan in saved.nodes:
        if not len(node_plan.plan) and node_plan.plan.changes:
            raise InputFileError(f"{file}: node {node_plan.node_id} changes nothing", place=file)
    with received_ids(session.bus) as received:
        node_plans = [_up_to_date(nodes[node_plan.node_id], node_plan) for node_plan in saved.nodes]
        refuse_impossible_stores(nodes, {node_plan.node_id: node_plan.store for node_plan in node_plans})
        network_plan = replace(saved, nodes=tuple(check_plans(nodes, node_plans, force=session.options.force)))
        of_device = any(node_plan.needs_power_off for node_plan in network_plan.nodes)
        return checked_network(session, network_plan, received, of_device=of_device)


def _up_to_date(node: ReadableNode, node_plan: NodePlan) -> NodePlan:
    """Add data of *node* to *node_plan*; raises SafetyRefusal if the node differs from the plan's basis."""
    from dvtcli.operations.plans.apply_network import refuse_stale

    boot_ups = node.bus.boot_ups(node.node_id)
    node.read_anew()
    refuse_stale(node, node_plan, (*node_plan.plan.changes, *node_plan.holds))
    changes = node_plan.plan.changes
    words = mapped_names(node, changes), scaled_changes(node, changes)
    return replace(node_plan, title=node.title, names=words[0], understood=words[1], boot_ups=boot_ups)


@contextmanager
def _opened(file: str) -> Iterator[None]:
    try:
        yield
    except OSError as failed:
        raise UsageError(f"{file}: {failed.strerror or failed}", place=file) from failed
