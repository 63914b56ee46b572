"""Check network files, a running network, or recordings: CAN-IDs, layouts, SYNC, heartbeats, load."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand, Effect
from dvtcli.cli.params import FILE, BitRateType, DurationType
from dvtcli.operations.user.options import SPECIAL_FORMATS
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation
    from dvtcli.operations.results import NetworksChecked, RecordingsChecked


@click.command(
    "check", cls=DvtCommand, short_help=__doc__, effect=Effect.NONE, needs_settings=False, formats=SPECIAL_FORMATS
)
@click.argument("files", type=FILE, nargs=-1, metavar="[FILE…]")
@click.option("--rule", "only", multiple=True, metavar="NAME", help="This rule only; repeatable.")
@click.option("--without", multiple=True, metavar="NAME", help="Skip this rule; repeatable.")
@click.option("--all", "shows_all", is_flag=True, help="Also warnings and notes about PDOs that FILE does not name.")
@click.option("--strict", is_flag=True, help="Treat warnings as errors.")
@click.option(
    "--at", "bit_rate", type=BitRateType(), metavar="BIT/S", help="The bus's bit rate [its own, or the file's]."
)
@click.option("--live", is_flag=True, help="Check the nodes on the bus, too, and compare them with FILE.")
@click.option(
    "--for",
    "for_s",
    type=DurationType(0, 3600),
    metavar="TIME",
    help="Time to receive from the bus [2s]; 0: none.",
)
@click.option(
    "-d", "--dbc", type=FILE, metavar="FILE", help="For a recording: the DBC or network file that describes it."
)
@click.pass_obj
def command(
    session: Conversation,
    /,
    files: tuple[str, ...],
    bit_rate: int | None,
    live: bool,
    for_s: float | None,
    dbc: str | None,
    **chosen: Any,
) -> NetworksChecked | RecordingsChecked:
    """Find errors in network files (YAML), in the nodes on a bus, or in recordings; writes nothing.

    A file: syntax errors with line, column and a caret, then the findings of the rules in the network that its nodes'
    EDS, DCF or family describe. An error in a file is exit code 4, in nodes 3; the other files are checked even if a
    file is wrong or missing. Warnings and notes about PDOs that FILE does not name are counted, and shown with --all;
    they do not count for --strict. Without FILE, or with --live, the nodes on the bus: their values, SYNC, heartbeats,
    other masters, unknown frames; with --live also whether they fit FILE. --format github, junit or sarif is for CI.

    A recording (as `decode` reads; - is standard input): refused transfers, time-outs, restarts, missing heartbeats,
    emergencies, incomplete mappings, PDOs of a wrong length, RPDOs that no node sends, SYNC jitter, two senders or
    masters, a full bus (with --at, or by the network file's bit rate); each with its frames, exit code 3. PDOs are
    decoded by -d, by --eds, or by the mapping in it.

    \b
    check press.yaml
    check press.yaml bus.yml
    check line.yaml --strict --format github
    check line.yaml --rule unbounded-event-pdo --rule one-producer
    check --live --for 1s      the nodes on the bus, and the received frames, as in a recording
    check press.yaml --live    and compare them with the file
    check run.log -d press.yaml
    """
    if not all(file.lower().endswith((".yaml", ".yml")) for file in files):  # else no recording is to be read
        from dvtcli.operations.frames.check_recording import RecordingOptions, are_recordings, check_recordings

        if are_recordings(files):
            of_networks = {"live": live, "for_s": for_s, "all": chosen["shows_all"], "strict": chosen["strict"]}
            refuse_options(of_networks, "not for a recording", "leave it out; for example check run.log -d press.yaml")
            options = RecordingOptions(
                dbc, chosen["only"], chosen["without"], bit_rate or session.options.bitrate,
                as_findings=session.output.format in SPECIAL_FORMATS,
            )  # fmt: skip
            return check_recordings(session, files, options)
    refuse_options({"dbc": dbc}, "for recordings only", "network files are named without -d")
    if files and not live:
        refuse_options({"for_s": for_s or None}, "only with --live, which receives from the bus")
    from dvtcli.operations.network.check_networks import CheckOptions, check_networks

    as_findings = live or session.output.format in SPECIAL_FORMATS  # so that the rest is looked at, too
    rate = bit_rate or session.options.bitrate
    check_options = CheckOptions(bit_rate=rate, as_findings=as_findings, for_s=for_s, **chosen)
    if files and not live:
        return check_networks(files, check_options)
    from dvtcli.operations.network.check_live import check_all

    return check_all(session, files, check_options)
