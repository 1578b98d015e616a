"""Dawood et al. (2026): Ecoflex 00-30 cylinders compressed on an Instron, real logs."""
