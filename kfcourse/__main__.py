"""`python -m kfcourse` is the command `kfcourse`."""

from kfcourse.cli import main

main(prog_name="kfcourse")
