"""Report items of every experiment besides the views of its table."""
