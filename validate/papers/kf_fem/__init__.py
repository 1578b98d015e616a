"""Paper 001: Kalman filter finite elements on a small block under traction."""
