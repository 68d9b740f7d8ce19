"""`python -m armguard`: the command line."""

from armguard.cli import main

if __name__ == "__main__":
    main()
