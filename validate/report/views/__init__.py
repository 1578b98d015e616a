"""Views: tables, charts and sentences declared over rows of the long table.

`view` says what a view is, `view_filling` reads its rows, `drawers` show it as a static picture, on
a page and on a terminal; `standard` are the views of every report. Read `view` first.
"""
