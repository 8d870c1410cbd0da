"""What the commands do, without a terminal: each program takes checked arguments and writes the files of its folder."""
