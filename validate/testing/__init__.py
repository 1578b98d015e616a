"""Contract tests of readers, laws, schemes and filters, for plug-ins and for the package itself.

Each contract is a tuple of checks. A check is a function that raises `AssertionError` where the
part breaks the contract: `pytest.mark.parametrize("check", reader_contract)`.
"""

from validate.exports import lazily, names

_HOMES = {
    "readers": ("ReaderSample", "reader_contract"),
    "laws": ("law_contract",),
    "schemes": ("scheme_contract",),
    "filters": ("filter_contract",),
    "pulled_cube": ("refusal",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
