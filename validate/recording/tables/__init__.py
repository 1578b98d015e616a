"""Exports of testing machines: text in any language as a force-displacement recording."""
