"""Why something went wrong, in words that fit into a sentence."""

from __future__ import annotations


def reason_of(error: BaseException) -> str:
    """What the system says of an error, begun in lower case and without a full stop; of a file that it is no text."""
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8 text"
    text = str(getattr(error, "strerror", None) or error).rstrip(".")
    return text[:1].lower() + text[1:]
