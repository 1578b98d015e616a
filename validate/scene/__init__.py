"""What is simulated, declared: mesh, materials, supports, drives, cavities. No matrices."""
