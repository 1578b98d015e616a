"""Validation and experiment replay for real-time soft-tissue simulation.

Conventions, one page:

- One road, no way back: recording -> scene -> registration -> system -> run -> comparison ->
  report. Lower floors never import upper ones; everything that flows is a frozen dataclass.
- SI inside; reports show mm, kPa, N. Every field, column and axis has a unit.
- Unknowns are node-major: x0 y0 z0 x1 ... Quadratic meshes list vertices first, then edge nodes.
- Compression, plate force and closing displacement are positive. Pressure is gauge. A pressure's
  load is f_p = dV/dx, the normal pointing from the fluid into the solid.
- Transforms are named T_target_from_source and act on column vectors.
- Letters of the equations inside formula files, words at interfaces. K stiffness, E modulus
  (error in `compare.verdict`), nu Poisson ratio, u displacement, P pressure, V volume, R rotation
  in `register`.
- *measured* is a recording; *reference* is a finer or more exact model; never one for the other.

The same road from Python: `validate.replay` (load, compare).
"""

__version__ = "0.1.0"
