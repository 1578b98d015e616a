"""The command line: parse, call, print. Heavy libraries load inside the commands."""
