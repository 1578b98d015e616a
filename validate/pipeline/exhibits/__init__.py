"""What every experiment adds to a report besides the views of its table."""
