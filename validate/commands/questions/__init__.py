"""Questions of `validate new`, and the declaration that the answers make.

Start with `new`.
"""
