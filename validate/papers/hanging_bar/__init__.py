"""A bar that hangs under its weight: simulators of others against its converged drop."""
