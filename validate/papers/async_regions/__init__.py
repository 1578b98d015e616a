"""Paper 004: asynchronous regions around a touched place."""
