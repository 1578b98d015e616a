"""A stylus that touches the landmarks of a rigid body: its registration, and what it predicts."""
