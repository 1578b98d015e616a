"""`python -m validate`."""

from validate.cli.main import main

if __name__ == "__main__":
    main()
