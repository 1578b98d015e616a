"""Parts that this package adds to `validate` by the entry points of its pyproject.toml."""
