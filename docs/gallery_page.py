"""The gallery of docs/gallery.md: a card of each shipped experiment, then its README.

python docs/gallery_page.py REPORTS    writes the thumbnails, from figures of stored runs

sphinx-gallery executes scripts at each build; a shipped experiment runs for up to minutes, so cards
show committed thumbnails. Texts come from the declarations, their READMEs and the table of
docs/reference/experiments.md.
"""

import re
import sys
from pathlib import Path

from PIL import Image, ImageChops

from validate.catalogue import card, experiment_files

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PICTURES = HERE / "pictures" / "gallery"
SIZE = (480, 320)  # px
# The first figure that a run has shows its body, else what is compared.
FIGURES = (
    "outlines", "render_markers", "render_deformed", "map_error_explicit", "chart_displacement_end",
    "chart_curve_force", "chart_curve_force_x", "chart_displacement_tip", "intervals_limits",
)  # fmt: skip


def page() -> str:
    """Return cards and sections as Markdown."""
    files = experiment_files(ROOT)
    names, asked = sorted(files), _questions()
    cards = "\n".join(_card(name, files[name]) for name in names)
    sections = "\n".join(_section(name, asked[name]) for name in names)
    return f"::::{{grid}} 1 2 3 3\n:gutter: 3\n\n{cards}\n::::\n\n{sections}"


def _card(name: str, file: Path) -> str:
    declared = card(file)
    return (
        f":::{{grid-item-card}} {name}\n:img-top: pictures/gallery/{name}.webp\n"
        f":img-alt: {declared.title}\n:link: gallery-{name}\n:link-type: ref\n\n"
        f"{declared.title}\n\n*{declared.source}*\n:::\n"
    )


def _section(name: str, question: str) -> str:
    readme = (ROOT / "experiments" / name / "README.md").read_text("utf-8")
    title, _, text = readme.partition("\n")
    return f"(gallery-{name})=\n#{title}\n\n**Question.** {question}.\n{text}"


def _questions() -> dict[str, str]:
    """What each experiment asks, from the table of the shipped experiments."""
    table = (HERE / "reference" / "experiments.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \| .*? \| (.*) \| [01] \|$", table, re.MULTILINE)
    return {name: text[0].upper() + text[1:] for name, text in rows}


# --- thumbnails -----------------------------------------------------------------------------------


def write_thumbnails(reports: Path) -> None:
    PICTURES.mkdir(exist_ok=True)
    for name in sorted(experiment_files(ROOT)):
        runs = [p for p in reports.glob(f"{name}*/figures") if p.parent.name.split("+")[0] == name]
        files = (run / f"{figure}.png" for figure in FIGURES for run in runs)
        if file := next((file for file in files if file.is_file()), None):
            thumbnail(file).save(PICTURES / f"{name}.webp", quality=80)
        else:
            print(f"{name}: no figure below {reports}; `validate run {name} --quick` makes some")


def thumbnail(file: Path) -> Image.Image:
    """Return the figure on a white ground of the size of a card."""
    with Image.open(file) as figure:
        small = figure.convert("RGB")
    small = small.crop(ImageChops.invert(small).getbbox())  # without its white margins
    small.thumbnail(SIZE)
    ground = Image.new("RGB", SIZE, "white")
    ground.paste(small, ((SIZE[0] - small.width) // 2, (SIZE[1] - small.height) // 2))
    return ground


if __name__ == "__main__":
    write_thumbnails(Path(sys.argv[1]))
