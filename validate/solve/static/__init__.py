"""Static schemes: linear, Newton at large strain, contact, interpolation without mechanics.

Start with `quasi_static`, then `newton`.
"""
