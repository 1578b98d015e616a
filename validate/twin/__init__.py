"""Twins: simulated experiments recorded as if measured; scene + scheme + sensors + seed."""
