"""Where every failure ends: as a message and an exit code. Nothing else in the house calls `sys.exit`."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from dvtcli.errors import DvtcliError, UsageError

if TYPE_CHECKING:
    from dvtcli.session import Session

BUG = 70


class Bug(DvtcliError):
    """A fault in dvtcli itself."""

    exit_code = BUG
    slug = "bug"


class ResultsLost(DvtcliError):
    """What a command answered cannot be written where it should go; what it did before is done."""

    slug = "results_lost"


#: What only writing ends with: a full disk, a file that may not grow, a terminal that went away.
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


def guarded(session: Session, run: Callable[[], Any]) -> int:
    """Run something; its result's exit code, or that of the error, which is shown."""
    try:
        result = run()
    except DvtcliError as error:
        session.output.error(error, session.place)
        return error.exit_code
    except click.exceptions.Exit as finished:
        return finished.exit_code
    except click.ClickException as wrong:
        session.output.error(usage_error(wrong), session.place)
        return 2
    except (KeyboardInterrupt, click.Abort):
        code = session.cancellation.exit_code
        session.output.lines(["interrupted" if code == 130 else "terminated"])
        return code
    except (BrokenPipeError, SystemExit):  # click turns the first into the second
        _silence_stdout()
        return 0
    except Exception as bug:  # noqa: BLE001 - the one boundary: a bug becomes exit code 70 with its traceback kept
        if isinstance(bug, OSError) and bug.errno in _NO_ROOM:
            return _lost(session, bug)
        session.output.error(_bug(bug), session.place)
        return BUG
    finally:
        session.settle()
    return result if isinstance(result, int) else 0


def usage_error(wrong: click.ClickException) -> UsageError:
    """A click usage error in our own form, with the command's grammar as the hint."""
    ctx = getattr(wrong, "ctx", None)
    hint = None
    if ctx is not None and ctx.command.name != "dvtcli":
        usage = " ".join(ctx.command.collect_usage_pieces(ctx)).replace("[OPTIONS] ", "")
        hint = f"{ctx.info_name} {usage}; help {ctx.info_name}"
    return UsageError(" ".join(wrong.format_message().split()), hint=hint)


def _lost(session: Session, failed: OSError) -> int:
    """Say on stderr that results are lost, also where they are documents: stdout takes no more."""
    _silence_stdout()
    lost = ResultsLost(f"the results cannot be written: {failed.strerror}", state="unknown")
    session.output.error(lost, session.place, readable=True)
    return lost.exit_code


def _silence_stdout() -> None:
    """The reader of our pipe left: end quietly, also when Python flushes stdout at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _bug(bug: Exception) -> Bug:
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile(
        "w", prefix="dvtcli-crash-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        traceback.print_exception(bug, file=file)
    return Bug(
        f"a bug in dvtcli: {type(bug).__name__}: {bug}", hint=f"please report it with {file.name}", state="unknown"
    )
