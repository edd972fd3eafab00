"""`python -m romdam`."""

from romdam.cli import main

if __name__ == "__main__":
    main()
