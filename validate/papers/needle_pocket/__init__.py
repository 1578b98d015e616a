"""Paper 000, section 5.2: a needle at haptic rate against a body with a fluid pocket."""
