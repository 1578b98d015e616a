"""Write the tables of formats and `--map` keys in docs/reference/formats.md, from the readers.

python docs/format_tables.py
"""

from pathlib import Path

from validate.recording.readers import with_tables

PAGE = Path(__file__).with_name("formats.md")

if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text("utf-8")), "utf-8")
