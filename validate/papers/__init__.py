"""What papers printed, replayed: scenes, twins, figures and exhibits. Nothing below imports it."""

__all__ = ["accuracy", "ecoflex", "ekf_nfem", "fluid_inclusion", "kf_fem", "swinging"]
