"""A clamped silicone beam let go under its weight: motion capture by others, MIT licence."""
