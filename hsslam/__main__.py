"""`python -m hsslam`: the command, where the scripts of an environment are not on the path."""

from hsslam.cli.main import main

# Processes that a sweep starts import this module, too.
if __name__ == "__main__":
    main()
