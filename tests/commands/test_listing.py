"""What `validate list NAME --json` may hold: numbers only."""

from types import SimpleNamespace

import pytest

from validate.commands import list as listing

# private: _document: replaced, to bring a case about.


def test_a_number_that_is_none_is_never_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listing, "find", lambda *_: SimpleNamespace())
    monkeypatch.setattr(listing, "_document", lambda experiment: {"limit": float("nan")})
    with pytest.raises(ValueError, match="not JSON compliant"):
        listing.show("cube", (), as_json=True)
