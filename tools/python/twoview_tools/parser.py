"""An argument parser whose errors are one line, as those of the program twoview."""

import argparse


class Parser(argparse.ArgumentParser):
    """`speaker`: what the line begins with; without: the program's name."""

    def __init__(self, *, speaker=None, **options):
        super().__init__(**options)
        self.speaker = speaker or self.prog

    def error(self, message):
        self.exit(2, f"{self.speaker}: {message} (see {self.prog} --help)\n")
