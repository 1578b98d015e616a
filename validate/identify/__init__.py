"""Parameters from recordings, each with its uncertainty and the samples it came from."""
