"""MCAP files: verified front to back, read by index, written completely or not at all."""
