"""Correct a line that cannot be read: its nearest readable form, as a hint or for the prompt. Runs nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dvtcli.cli.catalogue import command_names, meant, nearest_command
from dvtcli.cli.dvt.words import WORDS
from dvtcli.cli.global_options import PREFIX
from dvtcli.cli.parse_line import SHELL_WORDS, parse, without_program
from dvtcli.cli.pdo_params import PdoType
from dvtcli.cli.registry import REGISTRY
from dvtcli.cli.usage_errors import usage_error
from dvtcli.cli.view.typed_hints import prompt_line
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_syntax import PDO_CAN_IDS, AmbiguousName, UnknownName
from dvtcli.errors import DvtcliError, UsageError
from dvtcli.operations.user.options import START_ONLY

if TYPE_CHECKING:
    from dvtcli.cli.conversation import Conversation

#: maximum number of corrections of one line
_MOST_CORRECTIONS = 3
#: maximum number of lines tried: a person waits
_MOST_TRIED = 60
#: longer lines are not corrected
_MOST_WORDS = 40
#: the last TCP port
_HIGHEST_PORT = 0xFFFF
#: options that print and end during parsing
_ANSWERED_AT_ONCE = frozenset({"-h", "--help", "--version"})
#: a PDO, perhaps misspelt, with its node
_LIKE_A_PDO = re.compile(r"((?:\d{1,3}:)?)([A-Za-z]{3,5})[-_]?(\d{1,3})")
#: the nearest words, at the end of a message
_SUGGESTION = re.compile(r"[;,.]? \(?did you mean (?:(?!did you mean )[^?])*\?\)?$", re.IGNORECASE)
#: the nearest command, in the message about an unknown one
_NEAR_COMMAND = re.compile(r"^unknown command .*; did you mean '([a-z_]+)'\?$")
#: the message about a name with blanks
_ONE_NAME = re.compile("'([^']+)' is one name")
_DIRECTIONS = ("tpdo", "rpdo")
#: options this near (0…1) to a typed one are meant
_NEAR = 0.7
#: so few letters are near to too many words
_SHORT = 3
#: an object's name this near (0…1) is meant, if the next name is farther by _APART
_SAME_NAME, _APART = 0.85, 0.05
#: options that answer a question or lift a rule: only who types them means them
_NEVER_ADDED = frozenset({"--yes", "--force"})
#: the file that a line without one may be meant for
_FILES = {"save": "session.dvt"}


def with_correction(
    wrong: click.ClickException | UsageError, words: Sequence[str], session: Conversation, *, in_file: bool = False
) -> UsageError:
    """Return the error of the line *words*, its hint being the corrected line if there is one.

    *in_file*: the line is one of a script, and is corrected there.
    """
    error = wrong if isinstance(wrong, UsageError) else usage_error(wrong)
    line = corrected(words, session)
    if line is not None and session.is_secret(prompt_line(line)):
        return error  # a passcode is not repeated
    if line is not None:
        error.text = without_suggestion(error.text)  # the hint has it
    if line is None and error.hint is None and (near := _NEAR_COMMAND.search(error.text)):
        error.text, error.hint = without_suggestion(error.text), f"did you mean `{near[1]}`? `help {near[1]}` shows it"
    if line is None and isinstance(error.__cause__, AmbiguousName):
        error.hint = _choices(words, error.__cause__, session, in_file=in_file)
    if line is None and (said := _event_timer_hint(words, session)):
        error.hint = said
    if line is not None and in_file:
        error.hint = f"did you mean `{prompt_line(line)}`?"
    elif line is not None:
        error.hint = Hint(Action.CORRECT, {"words": tuple(line)}, "did you mean {}?")
    return error


def _choices(words: Sequence[str], ambiguous: AmbiguousName, session: Conversation, *, in_file: bool) -> Hint | str:
    """Offer the line with each object that the name means, at most three that can be read; else their numbers."""
    spelled = re.compile(rf"(\d+:)?{re.escape(ambiguous.name)}(/\d+)?")
    places = [(word, spelled.fullmatch(word)) for word in words]
    lines = ([f"{name[1] or ''}{choice}{name[2] or ''}" if name else word for word, name in places]
             for choice in ambiguous.choices)  # fmt: skip
    read = [line for line in lines if line != list(words) and _fault(line, session) is None][:3]
    if in_file or not read:
        return f"write {' or '.join(ambiguous.choices[:3])}"
    first, *others = (Hint(Action.CORRECT, {"words": tuple(line)}, "{}") for line in read)
    return reduce(lambda said, hint: said + replace(hint, why=" or {}"), others, first)


def _event_timer_hint(words: Sequence[str], session: Conversation) -> str:
    """Say what `--event 99999` may mean, and why the event timer does not take it; empty for another line."""
    for at, word in enumerate(words[:-1]):
        if word == "--event" and words[at + 1].isdigit():
            fault = _fault([*words[:at], "--timer", *words[at + 1 :]], session)
            _, wrong_timer, why = ("" if fault is None else fault.text).partition("Invalid value for '--timer': ")
            return f"--event has no value; --timer MS sets the event timer: {why}" if wrong_timer else ""
    return ""


def without_suggestion(text: str) -> str:
    """Return a message without the nearest words at its end."""
    return _SUGGESTION.sub("", text)


def corrected(words: Sequence[str], session: Conversation) -> list[str] | None:
    """Return the nearest line to *words* that can be read; None if *words* can, or if no line is near."""
    if not words or len(words) > _MOST_WORDS or _ANSWERED_AT_ONCE & set(words):
        return None
    first = list(words)
    if first[0] in SHELL_WORDS:
        try:
            first = without_program(first, session)
        except click.UsageError:
            return None  # it is about another bus or node
    fault = _fault(first, session)
    return _nearest(first, fault, session) if isinstance(fault, UsageError) else None


def _nearest(first: list[str], fault: UsageError, session: Conversation) -> list[str] | None:
    """Return the line that can be read after the fewest corrections of *first*; None if none is found."""
    tried, level = {tuple(first)}, [(first, fault)]
    for _ in range(_MOST_CORRECTIONS):
        nearer: list[tuple[list[str], UsageError]] = []
        for line, wrong in level:
            for candidate in _candidates(line, wrong):
                if tuple(candidate) in tried or len(tried) >= _MOST_TRIED:
                    continue
                tried.add(tuple(candidate))
                its_fault = _fault(candidate, session)
                if its_fault is None:
                    return candidate
                if isinstance(its_fault, UsageError):
                    nearer.append((candidate, its_fault))
        level = nearer
    return None


def _fault(words: list[str], session: Conversation) -> DvtcliError | None:
    """Return why *words* cannot be read, None if they can; no UsageError if a file cannot be read."""
    try:
        parse(words, session).close()
    except click.ClickException as wrong:
        return usage_error(wrong)
    except DvtcliError as wrong:
        return wrong
    return None


def _candidates(words: list[str], wrong: UsageError) -> Iterator[list[str]]:
    """Iterate over lines with one correction of *words*, the likeliest first."""
    name, *args = meant(words)
    command = REGISTRY.get_command(click.Context(REGISTRY), name)
    if command is None:
        yield from _of_unknown_command(name, args)
        return
    takes_pdo = any(isinstance(param.type, PdoType) for param in command.params)
    if takes_pdo:
        yield from ([name, *line] for line in _pdo_first(args))
        yield from ([name, *line] for line in _with_pdo(args))
    yield from ([name, *line] for line in _with_options(args, command))
    yield from ([name, *line] for line in _with_choice(args, command))
    yield from ([name, *line] for line in _with_name(args, wrong))
    if name in _FILES and wrong.text.endswith("'FILE'."):
        yield [name, _free(_FILES[name]), *args]


def _of_unknown_command(name: str, args: list[str]) -> Iterator[list[str]]:
    near = name.lower() if name.lower() in WORDS else nearest_command(name)
    if near in command_names() or near == name.lower():  # another word of the DVT is no sure guess: they are short
        yield [near, *args]
    for pdo, *rest in _with_pdo([name, *args]):
        yield [pdo, *rest]
    if _is_pdo(name) and args:
        yield ["map", name, *args]
        yield ["set", name, *args]


def _is_pdo(word: str) -> bool:
    try:
        PdoType().parse(word, None)
    except ValueError:
        return False
    return True


def _pdo_first(args: list[str]) -> Iterator[list[str]]:
    """Move a PDO to the front: `6041 tpdo1`."""
    for at, word in enumerate(args):
        if at and _is_pdo(word):
            yield [word, *args[:at], *args[at + 1 :]]
            return


def _with_pdo(args: list[str]) -> Iterator[list[str]]:
    """Correct a misspelt PDO: `tpd1`, `tdpo1`, `tpdo_1`, `tpdo 1`; not `pdo1`, which may be either."""
    for at, word in enumerate(args):
        joined = word + args[at + 1] if at + 1 < len(args) and args[at + 1].isdecimal() and word.isalpha() else ""
        for text, end in ((word, at + 1), (joined, at + 2)):
            like = _LIKE_A_PDO.fullmatch(text)
            if like is None or (text == word and _is_pdo(word)):
                continue
            letters = like[2].lower()
            near = [letters] if letters in _DIRECTIONS else [way for way in _DIRECTIONS if _one_edit(letters, way)]
            if len(near) == 1:
                yield [*args[:at], f"{like[1]}{near[0]}{int(like[3])}", *args[end:]]


def _one_edit(text: str, word: str) -> bool:
    """Whether *text* is *word* with a letter lacking, too many or wrong, or with two neighbours swapped."""
    if len(text) == len(word):
        other = [at for at, (char, right) in enumerate(zip(text, word, strict=True)) if char != right]
        return len(other) < 2 or (len(other) == 2 and sorted(text) == sorted(word) and other[1] == other[0] + 1)
    longer, shorter = sorted((text, word), key=len, reverse=True)
    return any(longer[:at] + longer[at + 1 :] == shorter for at in range(len(longer)))


def _with_options(args: list[str], command: click.Command) -> Iterator[list[str]]:
    """Write options as options: `timer 100`, `timer=100`, `-timer 100`, `--tmer 100`, `--cob-id 201`."""
    from difflib import get_close_matches

    names = _options(command)
    for at, word in enumerate(args):
        head, equals, value = word.partition("=")
        plain = _plain(head)
        if plain in names and head != names[plain]:
            yield [*args[:at], names[plain], *([value] if equals else []), *args[at + 1 :]]
        elif (
            word == "--port"
            and "listen" in names
            and args[at + 1 : at + 2]
            and args[at + 1].isdigit()
            and (int(args[at + 1]) <= _HIGHEST_PORT)
        ):
            yield [*args[:at], names["listen"], f"127.0.0.1:{args[at + 1]}", *args[at + 2 :]]
        elif word == "--event" and "timer" in names and args[at + 1 : at + 2] and args[at + 1].isdigit():
            yield [*args[:at], names["timer"], *args[at + 1 :]]
        elif (word.startswith("--") and head not in names.values()) or (word.isalpha() and len(word) > _SHORT):
            near = get_close_matches(plain, names, n=1, cutoff=_NEAR)
            if near:
                yield [*args[:at], names[near[0]] + equals + value, *args[at + 1 :]]
        elif at and args[at - 1] == "--cob-id" and re.fullmatch(r"[0-9A-Fa-f]{3,8}", word) and not _is_decimal_id(word):
            yield [*args[:at], f"0x{word}", *args[at + 1 :]]


def _with_choice(args: list[str], command: click.Command) -> Iterator[list[str]]:
    """Correct a misspelt word of an argument with fixed words: `nmt strat`."""
    words = [
        str(word)
        for param in command.params
        if isinstance(param, click.Argument) and isinstance(param.type, click.Choice)
        for word in param.type.choices
    ]
    for at, word in enumerate(args):
        near = next((other for other in words if word not in words and _one_edit(word.lower(), other)), None)
        if near is not None:
            yield [*args[:at], near, *args[at + 1 :]]


def _is_decimal_id(word: str) -> bool:
    """Whether *word* may be a PDO's CAN-ID in decimal."""
    return word.isdecimal() and PDO_CAN_IDS[0] <= int(word) <= PDO_CAN_IDS[1]


def _options(command: click.Command) -> dict[str, str]:
    """Return the options that a line of *command* may have, by their letters alone."""
    return {
        _plain(option): option
        for param in reversed(command.params)
        if isinstance(param, click.Option) and (param.name or "").removeprefix(PREFIX) not in START_ONLY
        for option in (*param.opts, *param.secondary_opts)
        if option.startswith("--") and option not in _NEVER_ADDED
    }


def _plain(option: str) -> str:
    return re.sub("[-_\u2010-\u2015\u2212]", "", option.lower())  # also the dashes of word processors


def _with_name(args: list[str], wrong: UsageError) -> Iterator[list[str]]:
    """Replace the unknown name of an object by the only near one; join the words of one name."""
    from difflib import SequenceMatcher

    if whole := _ONE_NAME.search(wrong.text):
        parts = whole[1].split(" ")
        at = next(at for at in range(len(args)) if args[at : at + len(parts)] == parts)
        yield [*args[:at], "_".join(parts), *args[at + len(parts) :]]
    unknown = wrong.__cause__
    if not isinstance(unknown, UnknownName) or not unknown.similar:
        return
    typed = next((word for word in args if repr(word) in str(unknown)), None)
    if typed is None:
        return
    alike = {name: SequenceMatcher(None, typed.lower(), name).ratio() for name in unknown.similar}
    nearest, *others = sorted(alike, key=lambda name: -alike[name])
    if alike[nearest] >= _SAME_NAME and all(alike[other] <= alike[nearest] - _APART for other in others):
        yield [nearest if word == typed else word for word in args]


def _free(name: str) -> str:
    """Return the name of a file that does not exist: *name*, or with a number."""
    path = Path(name)
    names = (name, *(f"{path.stem}-{number}{path.suffix}" for number in range(2, 100)))
    return next((free for free in names if not Path(free).exists()), name)
