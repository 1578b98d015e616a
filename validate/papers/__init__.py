"""What belongs to one paper: bodies, twins, printed figures. Nothing below imports it."""
