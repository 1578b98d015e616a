"""Ladder of an experiment: meshes, steps and solvers for studies of cost.

Start with `ladder`.
"""
