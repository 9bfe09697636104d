"""Files of a campaign to runs: level, drive and sensors from labels, units, groups and channels.

A universal file has them in ID lines, points and units; an HDF5 file in one group per run; a table of time histories in
one file per run; a table of steady states in one file or sweep. A drive in time is tracked block by block, so that a
file of any size takes the memory of a block.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from math import prod
from pathlib import Path

import numpy as np

from damping.campaign.functions import list_function_runs
from damping.campaign.runs import LABEL_AGREES, CampaignRun, Corrections, keep_common_sensors, summarise_runs
from damping.campaign.sensors import EXPLAINED, SCALINGS
from damping.campaign.tables import read_table_runs
from damping.campaign.tracked import Source, is_of_time, read_table
from damping.errors import InputError, naming
from damping.formats import check, detect_format
from damping.formats.arrays import Arrays, read_arrays, read_blocks
from damping.formats.columns import open_table
from damping.formats.headers import ROLE_NAMES, find_abscissa_factor
from damping.formats.levels import find_level
from damping.formats.quantity import unit
from damping.formats.sampling import split
from damping.formats.series import Stated, Summary
from damping.records.text import is_binary, name_apart, read_start
from damping.signals.windows import UNEVEN

SAMPLES = 2_000_000  #: samples of all channels that are read together
LOOKED_AT = 100_000  #: first bytes of a table from which its layout is determined


def read_runs(
    files: Sequence[Path], max_size: int, corrections: Corrections | None = None, facts: Stated | None = None
) -> tuple[list[CampaignRun], Summary]:
    """The corrected runs of some files, lowest level first, with their common sensors, and a summary.

    ``facts``: columns and units of tables of steady states.

    InputError: a file that cannot be read or contains no runs, with what is expected; a correction of an unknown run or
    channel; no sensor common to all runs.
    """
    summary, stated, facts = Summary(), corrections or Corrections(), facts or Stated()
    check(facts)
    runs: list[CampaignRun] = []
    channels: set[str] = set()
    for file in files:
        with naming(file):
            runs += _read(Source(Path(file), max_size, stated, summary, channels, facts))
    runs = [replace(run, label=label) for run, label in zip(runs, name_apart(r.label for r in runs), strict=True)]
    stated.require_known([run.label for run in runs], channels)
    out = {label for label, level in stated.levels.items() if level is None}
    runs = [replace(run, level=stated.levels.get(run.label, run.level)) for run in runs if run.label not in out]
    if not runs:
        raise InputError("every run is left out", file=stated.source or None, expected="one at least")
    if len({run.is_time for run in runs}) > 1:
        raise InputError("free decays beside sweeps", expected="files of one kind")
    runs = sorted((_drive_in(run, runs[0].drive_unit) for run in runs), key=lambda run: run.level or 0.0)
    summarise_runs(runs, summary)
    _refuse_copies(runs)
    _compare_labels([run for run in runs if run.label not in stated.levels], summary)
    return keep_common_sensors(runs), summary


def _drive_in(run: CampaignRun, drive_unit: str) -> CampaignRun:
    """The run with its drive and level in the unit of the others. InputError: that of another kind of drive."""
    if run.drive is None or run.level is None or run.drive_unit == drive_unit:
        return run
    if unit(run.drive_unit).powers != unit(drive_unit).powers:
        expected = "one kind of drive, or --correct FILE.toml: its unit"
        raise InputError(f"{run.label}: driven in {run.drive_unit}, others in {drive_unit}", expected=expected)
    k = unit(run.drive_unit).factor / unit(drive_unit).factor
    channels = tuple(channel.scaled(1.0 / k) if channel.per_drive else channel for channel in run.channels)
    return replace(run, drive_unit=drive_unit, drive=k * run.drive, level=k * run.level, channels=channels)


def _refuse_copies(runs: Sequence[CampaignRun]) -> None:
    """Raise InputError for a run that repeats another one in every number, as no measurement does."""
    seen: dict[bytes, str] = {}
    for run in runs:
        content = sha256()
        columns = [run.x, *(channel.samples for channel in run.channels)]
        for column in columns if run.drive is None else [*columns, run.drive]:
            content.update(column.tobytes())
        first = seen.setdefault(content.digest(), run.label)
        if first != run.label:
            expected = "each run once (--correct FILE.toml: out = true of one)"
            raise InputError(f"run {run.label!r} is run {first!r} again, in every number", expected=expected)


def _compare_labels(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """Note a caution if the drives of all runs read one factor times the levels in their labels."""
    labelled = [(run, find_level(run.label.replace("_", " "))) for run in runs]
    pairs = [(run, level) for run, level in labelled if run.level and level and level[0] > 0.0]
    alike = [unit(level[1]).powers == unit(run.drive_unit).powers for run, level in pairs]
    if len(pairs) < 2 or len(pairs) < len(runs) or not all(alike):
        return
    times = [float(run.level or 0.0) * unit(run.drive_unit).factor / (of * unit(u).factor) for run, (of, u) in pairs]
    if max(times) > (1.0 + LABEL_AGREES) * min(times) or min(abs(k - 1.0) for k in times) <= LABEL_AGREES:
        return
    causes = ((k, f" ({said})") for k, said in SCALINGS.items() if "of the drive" not in said)
    cause = next((said for k, said in causes if abs(times[0] / k - 1.0) < EXPLAINED), "")
    right = "its unit, scaling or gain (--correct: unit or scale of its channel), or the labels"
    summary.note(f"caution: in every run the drive reads {times[0]:.3g} times the level in the label{cause}: {right}")


def _read(source: Source) -> list[CampaignRun]:
    kind = detect_format(source.file)
    if kind in ("tdms", "hdf5"):
        contents = read_arrays(source.file, kind, [], None, rows=(0, 1))
        if contents.steps:
            source.refuse_columns()
            return _list_channel_runs(source, kind, contents)
        is_table = kind == "tdms" or source.facts.columns
        return read_table_runs(source) if is_table else _list_group_runs(source, kind, contents)
    if kind in ("mat5", "mat73") and not source.facts.columns:
        return _list_group_runs(source, kind, read_arrays(source.file, kind, [], None, rows=(0, 1)))
    if kind == "uff":
        return list_function_runs(source)
    start = read_start(source.file, LOOKED_AT)
    table = open_table(start) if kind == "csv" and start.strip() and not is_binary(start) else None
    return [read_table(source, table)] if table and is_of_time(table.headers) else read_table_runs(source)


def _list_group_runs(source: Source, kind: str, contents: Arrays) -> list[CampaignRun]:
    """Runs of a file of plain arrays: groups with times and a drive, tracked, and tables against frequency.

    If all groups with times have no drive, and there are no tables, they are free decays.
    """
    groups: dict[str, dict[str, str]] = {}
    for path in contents.known:
        *above, leaf = path.split("/") if kind == "hdf5" else split(path)
        groups.setdefault("/".join(above), {})[leaf] = path
    runs, decays, has_spectra = [], [], False
    for group, paths in groups.items():
        names = {role: [leaf for leaf in paths if leaf.lower() in ROLE_NAMES[role]] for role in ("frequency", "time")}
        has_spectra |= bool(names["frequency"] and any(map(source.stated.is_drive, paths)))
        if names["frequency"] or not names["time"]:
            continue
        t = paths[names["time"][0]]
        n = prod(contents.known[t])
        like = {leaf: path for leaf, path in paths.items() if prod(contents.known[path]) == n}
        if drive := source.stated.choose_drive(group or source.file.stem, dict.fromkeys(like, "")):
            runs.append(_track_group(source, kind, group, t, drive, like))
        elif len(like) > 1:
            decays.append((group, t, like))
    if not (runs or has_spectra) and decays:
        return [_read_decay(source, kind, *decay) for decay in decays]
    return runs + read_table_runs(source) if has_spectra or not runs else runs


def _read_decay(source: Source, kind: str, group: str, t: str, paths: Mapping[str, str]) -> CampaignRun:
    """The free decay of a group with times (at the path ``t``) and motions of one length, by name."""
    whole = read_arrays(source.file, kind, list(paths.values()), source.most)
    arrays = {path: values[0].real.reshape(-1) for path, values in whole.arrays.items()}
    times = arrays[t] * find_abscissa_factor("time", whole.units.get(t, ""))
    motions = {name: path for name, path in paths.items() if path != t}
    units = [(name, whole.units.get(path, "")) for name, path in motions.items()]
    source.require_units(units)
    return source.make_decay(group or source.file.stem, times, units, [arrays[path] for path in motions.values()])


def _track_group(source: Source, kind: str, group: str, t: str, drive: str, paths: Mapping[str, str]) -> CampaignRun:
    """The run of a group with times (at the path ``t``), a drive and responses of one length, by name."""
    first = read_arrays(source.file, kind, list(paths.values()), None, rows=(0, 1000))
    step = np.diff(first.arrays[t][0].real.reshape(-1)) * find_abscissa_factor("time", first.units.get(t, ""))
    if not len(step) or not np.all(np.abs(step / np.mean(step) - 1.0) < UNEVEN):
        raise InputError(f"{t} is not evenly spaced", expected="one step throughout, rising")
    taken = {name: path for name, path in paths.items() if path != t}
    blocks = read_blocks(source.file, kind, list(taken.values()), max(SAMPLES // len(taken), 1), together=False)
    named = [(name, first.units.get(path, "")) for name, path in taken.items()]
    return source.track(group or source.file.stem, named, drive, float(np.mean(step)), blocks)


def _list_channel_runs(source: Source, kind: str, contents: Arrays) -> list[CampaignRun]:
    """Runs of a file of channels with a time step, one for each group: tracked, or free decays."""
    groups: dict[str, list[str]] = {}
    for path in contents.steps:
        groups.setdefault(path.rpartition("/")[0], []).append(path)
    runs = []
    for group, paths in groups.items():
        label = group or source.file.stem
        units = [(path.rpartition("/")[2], contents.units.get(path, "")) for path in paths]
        steps, sizes = {contents.steps[path] for path in paths}, {contents.known[path] for path in paths}
        if len(steps) > 1 or len(sizes) > 1:
            raise InputError(f"channels of {label} of several rates or lengths", expected="one for all")
        start, step = next(iter(steps))
        drive = source.stated.choose_drive(label, dict(units))
        if drive is None:
            arrays = read_arrays(source.file, kind, paths if kind == "tdms" else [], source.most).arrays
            t = np.asarray(start + step * np.arange(next(iter(sizes))[0]))
            runs.append(source.make_decay(label, t, units, [arrays[path][0].reshape(-1) for path in paths]))
        else:
            most = max(SAMPLES // len(contents.known), 1)
            blocks = read_blocks(source.file, kind, paths, most, together=kind != "tdms")
            runs.append(source.track(label, units, drive, step, blocks))
    return runs
