# SPDX-License-Identifier: MIT
"""What checks in Python share, as verdict.sh is for those in bash: complaints
are collected, and a verdict prints them with one line "ok   CHECKS NAME" or
"FAIL CHECKS NAME"."""


class Verdicts:
    def __init__(self, checks):
        self.checks = checks
        self.complaints = []
        self.failed = False

    def complain(self, *words):
        self.complaints.append(" ".join(str(w) for w in words))

    def verdict(self, name):
        for c in self.complaints:
            print("     " + c)
        print(("FAIL" if self.complaints else "ok  ") +
              " %s %s" % (self.checks, name), flush=True)
        self.failed = self.failed or bool(self.complaints)
        self.complaints.clear()


def read(path):
    with open(path, "rb") as f:
        return f.read()
