"""``damping condition``: a raw accelerometer table to the record of one mode, step by step (report, chapter III).

What the user says about his test (CONDITION.toml) is documented in ``damping.signals.description``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from damping.records.record import record_to_csv
from damping.signals.chain import ConditioningStep
from damping.signals.description import Description
from damping.signals.reading import check_repeats, condition_steps, read_description, read_raw
from damping_pipelines.store import refuse_inputs, refuse_twice, write_text
from damping_pipelines.terminal import console, plain_table


def condition(raw: Path, config: Path, out: Path, steps: Path | None, max_size: int) -> None:
    """Condition a raw table, write the record and, where asked, one CSV a step; say what each step did.

    Raises:
        InputError: a description or a table that cannot be read or contradicts itself.
        AnalysisError: the steps that are asked for cannot be done on this table.
    """
    refuse_inputs("--out", out, raw, config)
    description = read_description(config)
    table = read_raw(raw, description, max_size)
    done = condition_steps(table, description)
    record = done[-1].after
    check_repeats(record, raw, max_size)
    texts = {} if steps is None else {steps / name: text for name, text in step_files(done).items()}
    for path in texts:
        refuse_inputs("--steps", path, raw, config)
    refuse_twice({"--out": out, **{f"--steps {path.name}": path for path in texts}})
    write_text(out, record_to_csv(record))
    for path, text in texts.items():
        write_text(path, text)
    _print(done, description, out)


def step_files(steps: tuple[ConditioningStep, ...]) -> dict[str, str]:
    """One CSV a step by file name: the table after it, what it removed, and what it found, on the rows before it."""
    files = {}
    for number, step in enumerate(steps, 1):
        removed = step.removed.add_prefix("removed ")
        table = step.after.reindex(step.before.index).join(removed)
        if len(step.after) < len(step.before):  # rows that were left out keep what the step does not change
            kept = step.before.loc[step.after.index]
            for name in step.before.columns.intersection(step.after.columns):
                if kept[name].equals(step.after[name]):
                    table[name] = step.before[name]
            table["left out"] = (~step.before.index.isin(step.after.index)).astype(int)
        table = table.assign(**step.constants)
        files[f"{number:02d}-{step.name.replace(' ', '-')}.csv"] = record_to_csv(table)
    return files


def _print(steps: tuple[ConditioningStep, ...], description: Description, out: Path) -> None:
    """What each step did, and where the record is."""
    terminal, table = console(), plain_table(description.title or out.stem, (), ("step", "report", "removed, at most"))
    for step in steps:
        removed = [f"{name} {np.nanmax(np.abs(step.removed[name])):.3g}" for name in step.removed]
        found = [f"{name} = {value:.4g}" for name, value in step.constants.items()]
        left = len(step.before) - len(step.after)
        rows = [f"{left} rows without a damping factor"] if left else []
        table.add_row(step.name, step.equation, ", ".join([*removed, *found, *rows]))
    terminal.print(table)
    names = {what: getattr(description.units, what) for what in ("force", "length", "time")}
    units = ", ".join(f"{what} in {unit}" for what, unit in names.items() if unit) or "one consistent system"
    terminal.print(f"{out}: {len(steps[-1].after)} rows of {len(steps[0].before)}. Units: {units}.")
