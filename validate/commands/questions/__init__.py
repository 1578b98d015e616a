"""Questions of `validate new`, and the declaration made from the answers.

Start with `new`.
"""
