"""click's usage errors in our own form, and unknown variables. Loaded only if there is one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from difflib import SequenceMatcher, get_close_matches

import click

from dvtcli.cli.global_options import PREFIX, VARIABLES, by_variable, global_options, variable_of
from dvtcli.cli.params import TEXT
from dvtcli.errors import UsageError


def usage_error(wrong: click.ClickException) -> UsageError:
    """A click usage error in our own form, with the command's grammar as the hint."""
    ctx = getattr(wrong, "ctx", None)
    if isinstance(wrong, click.NoSuchOption):
        wrong = click.NoSuchOption(wrong.option_name, possibilities=_near_options(wrong), ctx=wrong.ctx)
    hint, text = None, " ".join(_without_variable(wrong).format_message().split())
    if ctx is not None and ctx.command.name != "dvtcli":
        usage = " ".join(ctx.command.collect_usage_pieces(ctx)).replace("[OPTIONS] ", "")
        hint = f"{ctx.info_name} {usage}; {_in_quotes(ctx, text) or f'help {ctx.info_name}'}"
    return UsageError(text, hint=hint)


def _without_variable(wrong: click.ClickException) -> click.ClickException:
    """Return *wrong*, about its variable instead of the option if a value comes from there."""
    if isinstance(wrong, click.BadParameter) and wrong.ctx is not None and wrong.param is not None:
        name = (wrong.param.name or "").removeprefix(PREFIX)
        if by_variable(wrong.ctx, name):
            return click.UsageError(f"{variable_of(name)}: {wrong.message}", wrong.ctx)
    return wrong


def unknown_variables(names: Iterable[str]) -> Iterator[str]:
    """Describe each of the variables *names* that begins with `DVTCLI_` and means nothing to dvtcli."""
    known = {str(option.envvar) for option in global_options(hidden=False)} | {"DVTCLI_CONFIG", "DVTCLI_PASSCODE"}
    for name in sorted(names):
        if name.startswith(VARIABLES) and name not in known:
            near = get_close_matches(name, known, 1)
            yield f"{name} means nothing to dvtcli{f'; did you mean {near[0]}?' if near else ''}"


_EXTRA = r"(?s)Got unexpected extra arguments? \((.*)\)"


def _in_quotes(ctx: click.Context, text: str) -> str:
    """Suggest quotes if a command whose last argument is a text got extra words."""
    arguments = [param for param in ctx.command.params if isinstance(param, click.Argument)]
    extra = re.fullmatch(_EXTRA, text)
    if extra is None or not arguments or arguments[-1].type is not TEXT:
        return ""
    return f'put a value with a blank in quotes: "{ctx.params.get(arguments[-1].name or "")} {extra[1]}"'


#: Options this near (0…1) to a typed one are suggested.
_NEAR_OPTION = 0.7


def _near_options(wrong: click.NoSuchOption) -> list[str]:
    """Return those of click's suggestions whose letters are near to the typed option."""
    typed = wrong.option_name.strip("-")
    near = (SequenceMatcher(None, typed, name.strip("-")).ratio() for name in wrong.possibilities or ())
    return [name for name, ratio in zip(wrong.possibilities or (), near, strict=True) if ratio >= _NEAR_OPTION]
