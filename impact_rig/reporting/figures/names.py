"""Names of samples and runs, which may be anything, in ids and beside axes."""

LONGEST_NAME = 20
"""Characters of a name in a figure [-], our choice: a third of a panel."""


def shorten_name(name: str, longest: int = LONGEST_NAME) -> str:
    """Return a name that fits, without characters that XML has not.

    Its beginning and its end stay: names often differ there.
    """
    name = "".join(character if character.isprintable() else "\ufffd" for character in name)
    if len(name) <= longest:
        return name
    head = 2 * longest // 3 - 1
    return f"{name[:head].rstrip()}…{name[head + 1 - longest :].lstrip()}"


def make_name(*parts: str) -> str:
    """Return a name for ids and files, different for different parts.

    Letters and digits of ASCII stay, a blank becomes a hyphen, any other character its code
    point between underscores; the parts are joined by two hyphens.
    """
    return "--".join("".join(map(_encode, part)) for part in parts if part)


def _encode(character: str) -> str:
    if character.isascii() and character.isalnum():
        return character
    return "-" if character == " " else f"_{ord(character):x}_"
