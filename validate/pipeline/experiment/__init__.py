"""What an experiment declares: methods, parameters, variations, and its JSON form.

Start with `experiment`.
"""
