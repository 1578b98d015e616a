"""MCAP files: verified front to back, read by index, written whole or not at all."""
