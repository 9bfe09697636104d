"""The command line ``damping``: options in, one stage function called, exit codes out (0 done, 1 cannot, 2 bad input).

Heavy packages are imported by the command that needs them, so that ``damping --help`` answers at once.
"""

import errno
import gc
import os
import signal
import sys
import tomllib
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option
from typer.exceptions import TyperException

import damping_pipelines
from damping import __version__
from damping.errors import AnalysisError, InputError, Refused
from damping_pipelines import commands, leave_pyarrow_out, options
from damping_pipelines.options import delegate


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"damping {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Show no progress.")]


def _add_common(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command with the options that are accepted before and after its name, and ``-h``."""

    @wraps(command)
    def run(*, version: bool, quiet: bool, **own: Any) -> None:
        if quiet:
            damping_pipelines.QUIET.set(True)
        command(**own)

    common = (("version", Version), ("quiet", Quiet))
    further = [Parameter(name, Parameter.KEYWORD_ONLY, default=False, annotation=kind) for name, kind in common]
    own = signature(command, eval_str=True)
    # typer reads the options from here; mypy knows no such attribute of a function
    run.__signature__ = own.replace(parameters=[*own.parameters.values(), *further])  # type: ignore[attr-defined]
    return run


app = typer.Typer(
    name="damping",
    help="From a vibration test: the damping law, its certainty, and the resonance at the design load.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
@_add_common
def begin() -> None:
    """Options that apply to every command."""


@delegate(".study", "run_study")
def study(
    settings_file: Annotated[
        Path | None, Argument(metavar="STUDY.toml", help="Settings of a study; default: the Saturn V study.")
    ] = None,
    out: Annotated[Path | None, Option(metavar="DIR", help="Folder for the results; default: results/STUDY.")] = None,
    seed: Annotated[int | None, Option(min=0, help="Seed; overrides the settings.")] = None,
    png: Annotated[bool, Option("--png", help="Also write figures as PNG.")] = False,
    pdf: Annotated[bool, Option("--pdf", help="Also write the answer as a one-page PDF; needs Chromium.")] = False,
    despite: options.Despite = options.NONE,
) -> None:
    """Rank, sample, extrapolate and report: the whole study."""


@delegate(".tables")
def check(
    record: options.RecordArgument,
    mode: Annotated[Path | None, Option(metavar="MODE.toml", help="Mode to compare the record with.")] = None,
    json_out: options.Json = None,
    max_size: options.MaxSize = options.MAX_SIZE,
) -> None:
    """Check a record: units, phases, cut sweeps, copies. Exit code 1 if no answer can be right."""


@delegate(".laws")
def rank(
    record: options.RecordArgument,
    mode: options.ModeOption,
    json_out: options.Json = None,
    plot: options.Plot = None,
    seed: options.Seed = options.DEFAULT_SEED,
    despite: options.Despite = options.NONE,
    max_size: options.MaxSize = options.MAX_SIZE,
) -> None:
    """List every candidate damping law, best first."""


def _predict(
    record: options.RecordArgument,
    mode: options.ModeOption,
    force: options.Forces = options.NONE,
    amplitude: options.Amplitudes = options.NONE,
    level: options.Level = 0.9,
    json_out: options.Json = None,
    plot: options.Plot = None,
    seed: options.Seed = options.DEFAULT_SEED,
    despite: options.Despite = options.NONE,
    max_size: options.MaxSize = options.MAX_SIZE,
) -> None:
    """The options of both commands that predict resonances."""


#: What they predict.
_PREDICTIONS = {
    "extrapolate": "Amplitude at resonance beyond the test, with bands. Or the force for an amplitude.",
    "curve": "Damping ratio, Q and frequency against amplitude. With bands, in and beyond the test.",
}
#: Commands in the order of a newcomer's work: from a laboratory's file to the design load, many records, checks.
COMMANDS = {
    "import": commands.import_,
    "check": check,
    "rank": rank,
    **{name: delegate(".laws", name)(_predict) for name in _PREDICTIONS},
    "export": commands.export,
    "gap": commands.gap,
    "sweep": commands.sweep,
    "campaign": commands.campaign,
    "study": study,
    "compare": commands.compare,
    "fleet": commands.fleet,
    "verify": commands.verify,
    "condition": commands.condition,
    "regress": commands.regress,
    "blind": commands.blind,
    "bands": commands.bands,
    "calibrate": commands.calibrate,
}
#: The example that the help of each command ends with.
EXAMPLES = tomllib.loads(Path(__file__).with_name("examples.toml").read_text("utf-8"))
for _name, _command in COMMANDS.items():
    _example = f"Example: {EXAMPLES[_name]}" if _name in EXAMPLES else None
    app.command(_name, help=_PREDICTIONS.get(_name), epilog=_example)(_add_common(_command))


#: Objects made before a look for unused cycles among them: what loads, a hundred thousand objects that all stay, is
#: looked through 300 times otherwise, a tenth of a second.
COLLECT_AFTER = 300_000


USE_PYARROW = ("fleet", "export")  #: commands that read or write Parquet


def main(arguments: list[str] | None = None) -> None:
    """Entry point: every error becomes one line on standard error and its exit code, never a traceback."""
    if arguments is None:  # a process of its own
        command = _find_command(sys.argv[1:])
        if command == "fleet":
            # what has come is written and the cluster ended in order; other commands end at once, with their processes
            signal.signal(signal.SIGTERM, signal.default_int_handler)
        if command not in USE_PYARROW:
            leave_pyarrow_out()
    _replace_closed()
    damping_pipelines.QUIET.set(False)
    gc.set_threshold(COLLECT_AFTER)
    try:
        words = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
        code = app(args=words, prog_name="damping", standalone_mode=False)
        sys.stdout.flush()  # here, where a full disk can still be reported
        if code == 130:  # typer turns an interrupt into this code, without a word
            raise typer.Abort
    except (Refused, AnalysisError) as error:
        code = _fail(str(error), 1)
    except InputError as error:
        code = _fail(str(error), 2)
    except TyperException as error:  # a usage error: unknown option, missing argument, wrong type
        code = _fail(" ".join(error.format_message().split()), 2)
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        missing = f"the installation is not complete: {error}"
        if package in EXTRAS:
            name = "fleet" if _find_command(words) == "fleet" else EXTRAS[package]  # which brings all that it needs
            extra = f"'damping-selection[{name}]'"
            missing = f"this needs {package}, which is not installed; pip install {extra} brings it"
        code = _fail(missing, 1)
    except (typer.Abort, KeyboardInterrupt):
        code = _fail("interrupted; no half-written file is left", 130)
    except SystemExit:  # what the library of the command line makes of a closed standard output
        code = _fail("standard output was closed before all was written", 1)
        _discard_output()
    except MemoryError:
        code = _fail("not enough memory for this input", 1)
    except Exception as error:  # the promise is one line, never a traceback
        if os.environ.get("DAMPING_TRACEBACK"):
            raise
        if isinstance(error, OSError) and error.errno in OUTPUT_ERRORS:
            code = _fail(f"standard output cannot be written ({error.strerror})", 1)
            _discard_output()
        else:  # a mistake of ours
            line = f"{type(error).__name__}: {error}".splitlines()[0]
            code = _fail(f"internal error, please report it ({line}); DAMPING_TRACEBACK=1 shows where", 1)
    sys.exit(code if isinstance(code, int) else 0)


def _find_command(words: list[str]) -> str:
    """The command among the words, which may follow ``--quiet``."""
    return next((word for word in words if not word.startswith("-")), "")


#: What the system says of a closed or full standard output; errors of files are reported where files are written.
OUTPUT_ERRORS = (errno.EPIPE, errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EDQUOT)


def _replace_closed() -> None:
    """Discard what goes to a stream that was closed before the start, as a service may do; Python has None for it."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 (open until the end)


def _discard_output() -> None:
    """Discard the remaining output if standard output cannot be written, to avoid a second error at the end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


#: Packages that a bare install leaves out, and the extra that brings each.
EXTRAS = {"dask": "fleet", "distributed": "fleet", "pyarrow": "formats"}


def _fail(message: str, code: int) -> int:
    print(f"damping: {message}", file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
