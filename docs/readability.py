"""Words per sentence and readability of every page of the documentation.

python docs/readability.py

The automated readability index (ARI) is the school year that a text asks for. Code, tables,
headings and links' addresses are left out.
"""

import re
import sys
from pathlib import Path

import textstat

HERE = Path(__file__).resolve().parent
AIM = 18.0  # words per sentence


def prose(text: str) -> str:
    """The sentences of a Markdown page; every list item and paragraph ends in a full stop."""
    text = re.sub(r"```.*?```|<!--.*?-->", "", text, flags=re.DOTALL)
    parts: list[str] = []
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", text):
        lines = [line for line in block.splitlines() if not re.match(r"\s*(#|\||!\[)|    ", line)]
        words = " ".join(" ".join(lines).split())
        words = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", words)
        words = re.sub(r"`[^`]*`", "code", words)
        words = re.sub(r"\$[^$]*\$", "formula", words)
        words = re.sub(r"^(?:[-*]|\d+\.) |[*_]", "", words)
        words = re.sub(r"(?<=\d)[.,](?=\d)|(?<=[a-z])\.(?=[a-z])|\b(?:e\.g|i\.e|vs)\.", "", words)
        if words:
            parts.append(words if words[-1] in ".!?:" else f"{words}.")
    return " ".join(part.replace(":", ".") if part.endswith(":") else part for part in parts)


def row(path: Path) -> tuple[str, int, float, float]:
    """Name, words, words per sentence and ARI of a page."""
    name = str(path.relative_to(HERE)) if HERE in path.parents else path.name
    text = prose(path.read_text("utf-8"))
    words = len(text.split())
    if not words:
        return name, 0, 0.0, 0.0
    sentences = max(len(re.findall(r"[.!?](?=\s|$)", text)), 1)
    return name, words, words / sentences, float(textstat.automated_readability_index(text))


def main() -> None:
    pages = [Path(name) for name in sys.argv[1:]]
    if not pages:
        pages = [
            HERE.parent / "README.md",
            HERE.parent / "CHANGELOG.md",
            *sorted(HERE.rglob("*.md")),
        ]
    rows = sorted(map(row, pages), key=lambda r: -r[2])
    print(f"{'page':<36}{'words':>8}{'words / sentence':>18}{'ARI':>7}")
    for name, words, mean, ari in rows:
        print(f"{name:<36}{words:>8}{mean:>18.1f}{ari:>7.1f}{'' if mean <= AIM else '  long'}")
    total = sum(r[1] for r in rows)
    mean = sum(r[1] for r in rows) / sum(r[1] / r[2] for r in rows if r[2])
    print(f"{'all':<36}{total:>8}{mean:>18.1f}")


if __name__ == "__main__":
    main()
