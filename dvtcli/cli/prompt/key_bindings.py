"""The keys of the prompt, by prompt_toolkit, and when `?` asks for help."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

from prompt_toolkit.application import get_app, run_in_terminal
from prompt_toolkit.document import Document
from prompt_toolkit.enums import DEFAULT_BUFFER
from prompt_toolkit.filters import Condition, completion_is_selected, has_completions, has_focus
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent

from dvtcli.cli.prompt.line import last_line, typed_line

#: how long a corrected line is shown before Enter runs it (s): who presses Enter twice by habit has not seen it
_SEEN_S = 0.5


class ThrownAway(Exception):
    """The user discarded the line; a KeyboardInterrupt would break out of prompt_toolkit's event loop."""


@Condition
def _no_text() -> bool:
    """A question mark in quotes or in a comment is one; elsewhere no word has any."""
    text = last_line(get_app().current_buffer.document.text_before_cursor)
    line = typed_line(text)
    return line is not None and not any(quote in text[line.start :] for quote in "\"'")


@Condition
def _continued() -> bool:
    """Whether the line ends with a backslash."""
    document = get_app().current_buffer.document
    return document.is_cursor_at_the_end and document.text.endswith("\\")


@dataclass(slots=True)
class _Correction:
    """The last corrected *line*, and when it was shown (s, monotonic)."""

    line: str = ""
    shown_s: float = 0.0


def bindings(show_help: Callable[[str], None]) -> KeyBindings:
    """Return the additional keys; *show_help* prints help for the line so far."""
    keys, correction = KeyBindings(), _Correction()

    @keys.add("enter", filter=has_focus(DEFAULT_BUFFER))
    def _run(event: KeyPressEvent) -> None:
        """Run the line; one that cannot be read is replaced by the corrected line, which the next Enter runs.

        Not if more was typed already, and not within `_SEEN_S`: a second Enter would run a line that nobody saw.
        """
        buffer = event.current_buffer
        if buffer.text == correction.line and monotonic() - correction.shown_s < _SEEN_S:
            return
        buffer.validate_and_handle()
        refused = buffer.validation_error
        corrected: str | None = getattr(refused, "line", None)
        if corrected is not None and not event.key_processor.input_queue:
            buffer.save_to_undo_stack()
            buffer.document = Document(corrected)
            buffer.validation_error = refused
            correction.line, correction.shown_s = corrected, monotonic()

    @keys.add("enter", filter=has_completions & completion_is_selected)
    def _accept(event: KeyPressEvent) -> None:
        """Take the chosen word; the line is run by the next Enter."""
        event.current_buffer.complete_state = None

    @keys.add("enter", filter=_continued & has_focus(DEFAULT_BUFFER))
    def _continue(event: KeyPressEvent) -> None:
        """A backslash at the end: the command goes on in the next line."""
        event.current_buffer.newline(copy_margin=False)

    @keys.add("f1")
    @keys.add("?", filter=_no_text)
    def _help(event: KeyPressEvent) -> None:
        """Print help for the line so far, and keep the line."""
        line = event.current_buffer.text
        run_in_terminal(lambda: show_help(line))

    @keys.add("c-c", filter=has_focus(DEFAULT_BUFFER))
    @keys.add("<sigint>")
    def _throw_away(event: KeyPressEvent) -> None:
        """Discard the line; a second Ctrl-C in the meantime has no effect."""
        if event.app.is_running and not event.app.is_done:
            event.app.exit(exception=ThrownAway, style="class:aborting")

    return keys
