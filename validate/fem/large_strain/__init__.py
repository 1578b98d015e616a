"""Bodies at large strain: assembled for Newton, or as compiled forces for explicit steps.

Start with `hyperelastic`.
"""
