"""`python -m hsslam`: the command, where the scripts of an environment are not on the path."""

from hsslam.cli.main import main

main()
