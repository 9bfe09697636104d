"""``damping gap``: the gap between a simulation and a test, of one record or of a folder of cases (form ``gap/1``)."""

import importlib
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import redirect_stdout
from functools import wraps
from itertools import chain
from pathlib import Path
from textwrap import wrap
from typing import Any

import damping
from damping.errors import AnalysisError, DampingError, InputError, escape_control
from damping.gap.simulator import Simulate
from damping.records.mode import describe_mode_to_toml, read_mode
from damping.records.reading import read_record
from damping.records.text import DEFAULT_MAX_SIZE, count
from damping.report import format_joined
from damping.result import DiagnosisResult
from damping_pipelines import start_pool
from damping_pipelines.manifest import digest_inputs, versions
from damping_pipelines.store import check_outputs, refuse_unwritable, write_answer, write_json
from damping_pipelines.terminal import console, progress, report_findings

FORMAT = "gap/1"
COMMENT_WIDTH = 116  #: characters of a line of comment


def gap(
    model: Path,
    records: Sequence[Path],
    report: Path | None,
    model_out: Path | None,
    json_out: str | None,
    posterior: bool | None,
    seed: int,
    max_size: int,
    jobs: int | None,
    despite: Collection[str],
    states: Sequence[Path],
    simulator: str | None,
    plot: Path | None,
) -> None:
    """Diagnose one record, or, without ``records``, every case of the folder ``model`` into the folder ``json_out``.

    ``posterior`` is on unless False for one record, and off for a folder. ``states``: models of further states of the
    structure, whose records follow the first. ``simulator``: ``MODULE:FUNCTION``. InputError: bad usage or input.
    AnalysisError: the diagnosis cannot be made, or some cases of a folder failed.
    """
    if len(records) != len(states) + bool(records):
        expected = "MODEL.toml RECORD.csv, also after --with"
        raise InputError(f"{count(len(records), 'record')} for {count(1 + len(states), 'model')}", expected=expected)
    files = {"--model-out": model_out, "--report": report, "--plot": plot}
    if not records:
        answers = _check_folder(model, json_out, {**files, "--simulator": simulator, "--posterior": posterior or None})
        if diagnose_folder(model, answers, jobs, max_size, despite):
            raise AnalysisError("some cases could not be diagnosed; their answers give the reason")
        return
    if jobs is not None:
        raise InputError("--jobs is for a folder of cases", expected="one record without it")
    pairs = list(zip((model, *states), records, strict=True))
    inputs = list(chain.from_iterable(pairs))
    check_outputs({"--json": json_out, **files}, *inputs)
    read = [(read_record(data, max_size=max_size), read_mode(own, max_size=max_size)) for own, data in pairs]
    (record, mode), *further = read
    report_findings(record, mode, despite, diagnosed=True)
    result = damping.diagnose(
        record,
        mode,
        states=further,
        simulate=None if simulator is None else import_simulator(simulator),
        posterior=posterior is not False,
        seed=seed,
        despite=despite,
        progress=progress,
    )
    texts = {} if model_out is None else {model_out: _describe_model(result)}
    if report is not None:
        texts[report] = _render_page(result, seed, inputs)
    write_answer(json_out, result, plot, texts)
    for sentence in result.sentences if json_out != "-" else ():
        console().print(sentence)


def _describe_model(result: DiagnosisResult) -> str:
    """The corrected model; its head states the correction, its probability, and where not to use the model."""
    from damping.effects import list_lasting  # noqa: PLC0415 - as the next
    from damping.gap.weighing import KNOWN  # noqa: PLC0415 - a folder of cases is diagnosed by other processes
    from damping.report.gap import describe_diagnosis  # noqa: PLC0415 - as the line above

    diagnosis, corrected = result.diagnosis, result.diagnosis.corrected
    sentences = describe_diagnosis(diagnosis)["verdict"]
    if diagnosis.unexplained or diagnosis.in_library < KNOWN:
        sentences.append("It imitates the tested levels and may be worse than the simulation beyond them.")
    sentences += _describe_use(result)
    lasting = list_lasting(corrected.effects)
    if passing := [name for name in corrected.effects if name not in lasting]:
        sentences.append(
            f"Part of the rig or of this test, not of the structure: {format_joined(passing)}. `damping gap` applies "
            "it to this record; for a load, `damping sweep --structure` leaves it out."
        )
    lines = wrap(escape_control(" ".join(sentences)), COMMENT_WIDTH, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines) + describe_mode_to_toml(corrected)


def _describe_use(result: DiagnosisResult) -> list[str]:
    """What a corrected model does not hold: further states, the participation of a base, a simulator of the user's."""
    from damping.gap.corrected import refitted_values  # noqa: PLC0415 - a folder of cases is diagnosed by other processes

    diagnosis, corrected, sentences = result.diagnosis, result.diagnosis.corrected, list[str]()
    fitted = refitted_values(diagnosis.leading.best)
    if diagnosis.states and diagnosis.leading.effects:
        count = 1 + len(diagnosis.states)
        sentences.append(f"This is the first of {count} states: the effects belong in the models of the others too.")
    if corrected.drive == "base":
        shared = next((value for name, value in fitted.items() if name.startswith("participation of state 1")), 0.0)
        p = diagnosis.unit * (1.0 + shared) / corrected.mass
        sentences.append(
            f"The participation is {p:.4g} here, and 1 in `damping sweep`: give that {p:.4g} times the acceleration."
        )
    if diagnosis.simulate is not None:
        own = diagnosis.setting.problem.simulation.simulator
        values = {name: own.values[name] * (1.0 + fitted[name]) for name in own.values} if own else {}
        parameters = format_joined([f"{name} = {value:.5g}" for name, value in values.items()])
        sentences.append(
            "The mode of this file only stands for the simulator, so `damping sweep` does not reproduce the test. "
            "`damping gap` with the simulator applies the effects beside it"
            f"{': give it ' + parameters if parameters else ''}."
        )
    return sentences


def _render_page(result: DiagnosisResult, seed: int, inputs: Sequence[Path]) -> str:
    from damping.report.gap_page import render_gap_page  # noqa: PLC0415 - only the page needs matplotlib
    from damping.report.page import Footer  # noqa: PLC0415 - as above

    footer = Footer(seed, versions(), digest_inputs(inputs))
    return render_gap_page(result.diagnosis, result.posterior, result.against, footer)


def _check_folder(model: Path, json_out: str | None, of_one_record: Mapping[str, object]) -> Path:
    """The folder for answers to a folder of cases. InputError: no folder, or options that are for one record."""
    if not model.is_dir():
        raise InputError("no record beside it", file=model, expected="MODEL.toml RECORD.csv, or a folder of cases")
    if given := [option for option, value in of_one_record.items() if value is not None]:
        raise InputError(f"{given[0]} is for one record", expected="MODEL.toml RECORD.csv, or the folder without it")
    if json_out is None or json_out == "-":
        raise InputError("a folder of cases needs a folder for the answers", expected="--json OUT_DIR")
    refuse_unwritable(Path(json_out), folder=True)
    return Path(json_out)


def import_simulator(name: str) -> Simulate:
    """The function of ``MODULE:FUNCTION``, with the working folder searched first.

    What it or its module prints goes to standard error: standard output is for the answer.
    InputError: a module or function that does not exist or cannot be loaded.
    """
    module, _, function = name.partition(":")
    if not module or not function:
        raise InputError(f"--simulator {name!r}", expected="MODULE:FUNCTION")
    sys.path.insert(0, str(Path.cwd()))
    try:
        with redirect_stdout(sys.stderr):
            named = getattr(importlib.import_module(module), function, None)
    except (Exception, SystemExit) as error:
        raise InputError(f"--simulator: {error!r}", expected="a module in the working folder or installed") from None
    finally:
        sys.path.pop(0)
    if not callable(named):
        raise InputError(f"--simulator: {module} has no function {function}", expected="MODULE:FUNCTION")

    @wraps(named)
    def simulate(*args: Any, **parameters: Any) -> Any:
        with redirect_stdout(sys.stderr):
            return named(*args, **parameters)

    return simulate


def diagnose_folder(
    cases: Path, out: Path, jobs: int | None, max_size: int = DEFAULT_MAX_SIZE, despite: Collection[str] = ()
) -> int:
    """Diagnose ``NAME/model.toml`` with ``NAME/data.csv`` of every NAME in ``cases`` into ``out/NAME.json``.

    A case that fails gets ``{"format", "error"}`` and the others go on. Returns how many failed.
    InputError: ``cases`` holds no case.
    """
    names = sorted({path.parent.name for name in ("model.toml", "data.csv") for path in cases.glob(f"*/{name}")})
    if not names:
        raise InputError("holds no case", file=cases, expected="NAME/model.toml with NAME/data.csv")
    failed = 0
    with progress("diagnosing", len(names), each=True) as advance, start_pool(jobs) as pool:
        futures = {pool.submit(diagnose_case, cases / name, max_size, despite): name for name in names}
        for future in as_completed(futures):
            name, error = futures[future], future.exception()
            failure = {"format": FORMAT, "error": f"{type(error).__name__}: {error}"}
            answer = future.result() if error is None else failure
            write_json(out / f"{name}.json", answer)
            failed += "error" in answer
            advance(f"{name} failed: {answer['error']}" if "error" in answer else name)
    return failed


def diagnose_case(folder: Path, max_size: int = DEFAULT_MAX_SIZE, despite: Collection[str] = ()) -> dict[str, Any]:
    """The answer of one case, or ``{"format", "error"}``; a record that the audit refuses is an error."""
    started = time.process_time()
    try:
        record = read_record(folder / "data.csv", max_size=max_size)
        mode = read_mode(folder / "model.toml", max_size=max_size)
        result = damping.diagnose(record, mode, compare=False, despite=despite)
        spent = time.process_time() - started  # without the next test, which is found on demand
        return {**result.to_json(), "cpu_seconds": spent}
    except DampingError as error:
        return {"format": FORMAT, "error": str(error)}
