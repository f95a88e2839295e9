"""`python -m kfcourse` is the command `kfcourse`."""

from kfcourse.commands import main

main(prog_name="kfcourse")
