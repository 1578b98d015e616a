"""Report of a result: HTML page, results.json, tables, figures and the runs' fields.

Arrays stay SI; `numbers` alone turns them into what people read (mm, N, Pa). Each section of the
page is a function of the result that returns None where it does not apply. matplotlib draws in the
files named after what they show, pyvista in `panels` only, jinja2 fills the page
in `html` only.
"""

from validate.exports import lazily, names

_HOMES = {
    "write": ("write_report",),
    "stored.store": ("document", "schema"),
    "stored.tables": ("StoredTables",),
    "export.fields": ("open_fields",),
    "views.standard": ("VIEWS", "View"),
    "long_table": ("LongRow", "RowBlock"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
