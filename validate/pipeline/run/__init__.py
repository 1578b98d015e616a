"""Runs of an experiment: each method with each change, as cells of the engine.

Start with `pipeline`.
"""
