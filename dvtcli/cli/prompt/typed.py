"""A line that is still being typed, taken apart the way `registry.split` takes apart a finished one.

Does not know commands.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TypedLine:
    """The finished *words* before the cursor, and the one being typed: its text and where it starts in the line."""

    words: list[str]
    incomplete: str
    start: int


def typed(text: str) -> TypedLine | None:
    """Take apart the text before the cursor; None inside a comment."""
    words: list[str] = []
    word: list[str] = []
    start, quote, inside = 0, "", False
    for position, char in enumerate(text):
        if quote:
            if char == quote:
                quote = ""
            else:
                word.append(char)
        elif char.isspace():
            if inside:
                words.append("".join(word))
            word, inside = [], False
        elif char == "#" and not inside:
            return None
        else:
            if not inside:
                start, inside = position, True
            if char == '"' or (char == "'" and start == position):
                quote = char
            else:
                word.append(char)
    return TypedLine(words, "".join(word), start if inside else len(text))


def last_line(text: str) -> str:
    """The line that the cursor is in: of pasted lines the last one, with the parts that a backslash continues.

    As long as the end of *text* that it stands for, so that positions from the end stay what they are.
    """
    return text.replace("\\\n", "  ").rpartition("\n")[2]


def quoted(word: str) -> str:
    """*word* as it must be typed to stay one word."""
    if word and not any(char.isspace() or char in "\"'#" for char in word):
        return word
    return f'"{word}"' if '"' not in word else f"'{word}'"
