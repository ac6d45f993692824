"""How the commands' help texts are set."""

from __future__ import annotations


def flowing(text: str) -> str:
    """A help text whose paragraphs break only where the terminal ends, and whose indented examples stand one below the other.

    The command line's library keeps line breaks as they are, and takes the indent away from what follows the first
    paragraph unless that begins with an empty line.
    """
    first, *others = text.strip().split("\n\n")
    set_so_far = ""
    for paragraph in others:
        if paragraph.startswith("  "):
            set_so_far += "\n" + paragraph
        else:
            set_so_far += "\n\n" + _joined(paragraph)
    return f"{_joined(first)}\n{set_so_far}"


def _joined(paragraph: str) -> str:
    return " ".join(paragraph.split("\n"))
