"""Two deformed bodies or displacement fields side by side: the metrics of paper 002.

Start with `two_fields`.
"""
