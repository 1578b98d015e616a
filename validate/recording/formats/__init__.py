"""Third-party formats, each with its library behind one module."""
