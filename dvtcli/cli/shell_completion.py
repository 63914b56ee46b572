"""Make completions safe: names come from untrusted files, and a shell prints them."""

from __future__ import annotations

from collections.abc import Iterable

from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, get_completion_class

from dvtcli.domain.text import safe

_SHELLS = ("bash", "zsh", "fish", "powershell")


def safe_items(items: Iterable[CompletionItem]) -> list[CompletionItem]:
    """Return *items* with safe help texts, without items that would type control characters."""
    return [
        CompletionItem(item.value, item.type, None if item.help is None else safe(item.help))
        for item in items
        if safe(item.value) == item.value
    ]


class _SafeComplete(ShellComplete):
    def get_completions(self, args: list[str], incomplete: str) -> list[CompletionItem]:
        """Return click's completions, made safe."""
        return safe_items(super().get_completions(args, incomplete))


def make_shells_safe() -> None:
    """Let click give safe completions to every shell."""
    for name in _SHELLS:
        usual = get_completion_class(name)
        if usual is None:  # PowerShell came with click 8.5
            continue

        class Safe(_SafeComplete, usual):  # type: ignore[misc, valid-type]
            pass

        add_completion_class(Safe, name)
