"""Names of files and folders made of any text: of a probe, a marker, a channel, a specimen."""

import hashlib
import re

_ODD = re.compile(r"[^A-Za-z0-9._+ -]")
_LONGEST = 100  # characters: an ending and a folder's parts come on top


def safe_name(text: str) -> str:
    """Return a name that every file system takes, the text itself where it is one.

    Other signs become `_`, and six digits of a hash keep different texts apart.
    """
    plain = _ODD.sub("_", text)[:_LONGEST].strip(" .")
    if text and plain == text:
        return text
    mark = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:6]
    return f"{plain}-{mark}" if plain else mark
