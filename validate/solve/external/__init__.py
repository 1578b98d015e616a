"""External simulators: `validate` writes a job into a folder, the program writes its answer."""
