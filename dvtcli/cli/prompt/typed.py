"""Split an unfinished line as `registry.split` splits a finished line."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TypedLine:
    """The finished *words* before the cursor, and the current word: text and start in the line."""

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
    """Return the cursor's line: the last of pasted lines, joined with lines continued by backslashes.

    The result is as long as the corresponding end of *text*, so that positions from the end stay valid.
    """
    return text.replace("\\\n", "  ").rpartition("\n")[2]


def quoted(word: str) -> str:
    """Quote *word* so that it stays one word."""
    if word and not any(char.isspace() or char in "\"'#" for char in word):
        return word
    return f'"{word}"' if '"' not in word else f"'{word}'"
