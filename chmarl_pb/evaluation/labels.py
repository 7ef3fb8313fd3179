"""Labels: by what names rows of tables may be called."""

from unicodedata import normalize

_OF_TABLES = "|<>"  # signs that end a cell of Markdown, or begin a tag of HTML


def label_fault(label: str) -> str:
    """Return why a row cannot be called so; empty if it can."""
    if signs := sorted({sign for sign in label if sign in _OF_TABLES or not sign.isprintable()}):
        return f"has {', '.join(map(ascii, signs))}, which tables do not show as such"
    if label != " ".join(label.split()):
        return "begins or ends with a space, or has several in a row"
    return ""


def are_alike(one: str, other: str) -> bool:
    """Return whether two labels read the same, whatever the case and form of their letters."""
    return _read(one) == _read(other)


def _read(label: str) -> str:
    return " ".join(normalize("NFKC", label).casefold().split())
