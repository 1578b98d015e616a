"""Declaration of an experiment: methods, parameters, variations, and its JSON form.

Start with `experiment`.
"""
