"""What papers printed, replayed: scenes, twins, figures and exhibits. Nothing below imports it."""
