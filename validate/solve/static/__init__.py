"""Static schemes: linear, Newton at large strain, contact, displacements without mechanics.

Start with `quasi_static`, then `newton`.
"""
