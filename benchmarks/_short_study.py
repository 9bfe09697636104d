"""Studies with two laws to rank and to predict with and one figure, each in a process of its own that may be killed.

A server: for each line ``SETTINGS<tab>OUT<tab>SEED`` on standard input it starts ``damping study`` as the leader of a
new session, answers with its process id, and with its exit status when it has ended. Packages are imported once and
each study is forked. Its own pool starts new processes, which is left as it is: they are killed with it.
"""

from __future__ import annotations

import os
import sys

import arviz  # noqa: F401 - diagnoses chains; imported before the processes part, as the next two
import matplotlib.figure  # noqa: F401 - draws figures
import netCDF4  # noqa: F401 - saves posteriors

from damping.infer.law import Law
from damping.report import figures
from damping.report import study as build
from damping_pipelines import study
from damping_pipelines.cli import main

LAWS = ("viscous", "velocity-squared")


def serve() -> None:
    """Start a study for each line of standard input and wait for it."""
    for name in ("candidate_laws", "resonant_laws"):
        vars(study)[name] = lambda *_: [Law((law,)) for law in LAWS]
    vars(build)["record_figures"] = lambda result, level: {"ranking": figures._draw_ranking(result)}
    for line in sys.stdin:
        settings, out, seed = line.rstrip("\n").split("\t")
        child = os.fork()
        if child == 0:
            os.setsid()
            quiet = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(quiet, stream)
            main(["study", settings, "--out", out, "--seed", seed])
        print(child, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


if __name__ == "__main__":
    serve()
