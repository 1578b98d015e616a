"""Pictures of every report page: desktop and telephone, light and dark.

python docs/screenshots.py REPORTS -o FOLDER [--height PIXELS]

Needs chromium on the PATH. One PNG for each page, width and colour scheme, and a contact sheet of
the first screens.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import click
from PIL import Image

WIDTHS = (1280, 375)
SCHEMES = {"light": 1, "dark": 0}  # chromium's numbers
SCREEN = (1280, 800)
COLUMNS, SHRUNK = 4, 2.5  # of the contact sheet
WAIT = 8000  # ms of the page's own clock, for figures to be built


def browser() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome", "chrome"):
        if found := shutil.which(name):
            return found
    raise click.ClickException("no chromium on the PATH; install it and run again")


def shoot(page: Path, picture: Path, width: int, height: int, scheme: str) -> None:
    with tempfile.TemporaryDirectory(prefix="validate-") as profile:
        subprocess.run(
            [browser(), "--headless=new", "--no-sandbox", "--hide-scrollbars",
             "--enable-unsafe-swiftshader", f"--user-data-dir={profile}",
             f"--window-size={width},{height}", f"--virtual-time-budget={WAIT}",
             f"--blink-settings=preferredColorScheme={SCHEMES[scheme]}",
             f"--screenshot={picture}", page.resolve().as_uri()],
            capture_output=True, check=True, timeout=180,
        )  # fmt: skip


def sheet(pictures: list[Path], file: Path) -> None:
    """First screens beside each other, in the order of their names."""
    size = (round(SCREEN[0] / SHRUNK), round(SCREEN[1] / SHRUNK))
    rows = -(-len(pictures) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * size[0], rows * size[1]), "white")
    for i, picture in enumerate(pictures):
        with Image.open(picture) as one:
            part = one.convert("RGB").crop((0, 0, *SCREEN)).resize(size)
        whole.paste(part, (i % COLUMNS * size[0], i // COLUMNS * size[1]))
    whole.save(file)


@click.command()
@click.argument("reports", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("-o", "out", type=click.Path(path_type=Path), required=True)
@click.option("--height", default=SCREEN[1], show_default=True, help="Pixels of each picture.")
def main(reports: Path, out: Path, height: int) -> None:
    pages = sorted(reports.glob("*/report.html"))
    if not pages:
        raise click.ClickException(f"no report below {reports}; `validate run` makes one")
    out.mkdir(parents=True, exist_ok=True)
    for page in pages:
        for width in WIDTHS:
            for scheme in SCHEMES:
                name = f"{page.parent.name}_{width}_{scheme}.png"
                shoot(page, out / name, width, max(height, SCREEN[1]), scheme)
        click.echo(page.parent.name)
    for scheme in SCHEMES:
        first = [out / f"{p.parent.name}_{WIDTHS[0]}_{scheme}.png" for p in pages]
        sheet(first, out / f"sheet_{scheme}.png")
    click.echo(f"{len(pages)} pages: {out}")


if __name__ == "__main__":
    main()
