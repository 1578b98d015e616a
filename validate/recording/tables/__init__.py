"""Exports of testing machines: text of any language as a force-displacement recording."""
