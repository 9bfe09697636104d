"""Functions of a universal file to runs: level, drive and sensors from ID lines, entities, points and units."""

import re
from collections.abc import Sequence

import numpy as np

from damping.campaign.runs import CampaignRun, find_level_of_ratio, refuse_forces
from damping.campaign.tracked import Source, find_step
from damping.errors import InputError
from damping.formats.excitation import note_excitation
from damping.formats.levels import DRIVE, LEVEL, find_level
from damping.formats.uff import Function, read_functions
from damping.records.text import read_bytes
from damping.signals.windows import UNEVEN, describe_uneven

#: A level in an ID line, with the word for it: it differs between runs and is not part of a sensor's name.
OF_LEVEL = re.compile(rf"(?:\b[Ll]evel\s*[:=]?\s*)?{LEVEL.pattern}")
_PRINTED = 1e-5  # relative error of an abscissa as text, which has six digits
_NO_LEVEL = "one run"  # the run of functions whose ID lines name no level


def list_function_runs(source: Source) -> list[CampaignRun]:
    """The runs of a universal file, one for each level. InputError: no drive, response or level, or a broken file."""
    source.refuse_columns()
    functions = read_functions(read_bytes(source.file, source.most), source.summary)
    if texts := [text for f in functions if f.of.function == 4 for text in (f.of.title, *f.of.notes)]:
        note_excitation((source.file.stem, *texts), source.summary)
    return [_join_functions(label, group, source) for label, group in _group_functions(functions).items()]


def _group_functions(functions: Sequence[Function]) -> dict[str, list[Function]]:
    """Functions of a universal file by level: that in the first ID line, else in another ID line of all functions.

    The other line must distinguish functions of the same title and place, or contain one level and nothing else. A
    level that only some name, such as the drive, is that of all if each is of another place.
    """
    places = [(f.of.title, f.of.place, f.of.function, f.of.quantity) for f in functions]
    labels = [_label_level(f.of.title) for f in functions]
    further = zip(*(f.of.notes for f in functions), strict=True) if set(labels) == {_NO_LEVEL} else ()
    for lines in further:
        in_line = [_label_level(line) for line in lines]
        bare = len(set(in_line)) == 1 and all(OF_LEVEL.fullmatch(line) for line in lines)
        apart = len(set(zip(in_line, places, strict=True))) == len(functions) > len(set(places))
        if _NO_LEVEL not in in_line and (bare or apart):
            labels = in_line
            break
    levels = set(labels) - {_NO_LEVEL}
    places_apart = len({(_drop_level(f.of.title), place[1:]) for f, place in zip(functions, places, strict=True)})
    if len(levels) == 1 and places_apart == len(functions):  # named by one function of a run, such as the drive
        labels = [levels.pop()] * len(labels)
    groups: dict[str, list[Function]] = {}
    for label, function in zip(labels, functions, strict=True):
        groups.setdefault(label, []).append(function)
    return groups


def _label_level(text: str) -> str:
    level = find_level(text)
    return f"{level[0]:g} {level[1]}" if level else _NO_LEVEL


def _name_functions(group: Sequence[Function]) -> list[str]:
    """Names of channels: first ID lines without their level where unique.

    Of the others, second ID lines if every one has its own, else response entities if so, else points of responses.
    """
    titles = [_drop_level(function.of.title) for function in group]
    is_name = [
        bool(title) and (titles.count(title) == 1 or bool(not f.of.per and DRIVE.search(title)))
        for title, f in zip(titles, group, strict=True)
    ]
    others = [f.of for f, named in zip(group, is_name, strict=True) if not named]
    candidates = ([_drop_level(of.notes[0]) for of in others], [of.entity for of in others])
    distinct = (names for names in candidates if all(names) and len(set(names)) == len(names) > 1)
    further = iter(next(distinct, [of.point for of in others]))
    return [title if named else next(further) for title, named in zip(titles, is_name, strict=True)]


def _drop_level(line: str) -> str:
    return " ".join(OF_LEVEL.sub("", line, count=1).split()).strip(" ,;:")


def _join_functions(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    """The run of some functions of a universal file: of frequency, or of time (tracked if one is the drive)."""
    if not any(function.of.is_time for function in group):
        return _read_spectra(label, group, source)
    units = [(name, f.of.numerator.unit) for name, f in zip(_name_functions(group), group, strict=True)]
    t = group[0].x
    if not all(function.of.is_time and len(function.x) == len(t) and np.allclose(function.x, t) for function in group):
        raise InputError(f"{label}: functions of time of several lengths", expected="one list of times")
    samples = [np.asarray(function.y).real for function in group]
    drive = source.stated.choose_drive(label, dict(units))
    if drive is None:
        return source.make_decay(label, t, units, samples)
    step = find_step(label, t)
    if np.max(np.abs(t - t[0] - step * np.arange(len(t)))) > max(UNEVEN * step, _PRINTED * np.max(np.abs(t))):
        raise InputError(describe_uneven(t), expected="one step throughout, rising")
    return source.track(label, units, drive, step, [np.array(samples)])


def _read_spectra(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    stated = source.stated
    drives: list[tuple[str, Function]] = []
    sensors: list[tuple[str, Function]] = []
    for name, f in zip(_name_functions(group), group, strict=True):
        source.channels.add(name)
        if stated.of(name).role != "out":
            is_drive = not f.of.per and (f.of.quantity == "force" or stated.is_drive(name))
            (drives if is_drive else sensors).append((name, f))
    ratio = bool(sensors) and bool(sensors[0][1].of.per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", expected="a channel named control, drive, base or force")
    x = sensors[0][1].x
    if any(len(f.x) != len(x) or not np.allclose(f.x, x, rtol=1e-4, atol=0.0) for _, f in (*drives, *sensors)):
        raise InputError(f"{label}: channels at different frequencies", expected="one list of frequencies")
    source.note_scaling(text for f in group for text in (f.of.title, *f.of.notes))
    made = []
    for name, sensor in sensors:
        of, samples = sensor.of, np.asarray(sensor.y)
        known = {"per_drive": bool(of.per), "at_drive": of.per == "force" and of.response_point == of.reference_point}
        made.append(source.make_channel(name, of.numerator.unit, samples, of.quantity, **known))
    channels = tuple(filter(None, made))
    if ratio:
        size, drive_unit = find_level_of_ratio(label, sensors[0][1].of.denominator.unit)
        drive = np.full(len(x), size, dtype=complex)
        return source.leave_flat(CampaignRun(label, size, drive_unit, x, drive, channels))
    if len(drives) > 1 and any(f.of.is_force for _, f in drives):
        raise refuse_forces(label, [name for name, _ in drives])
    control = stated.join_controls([f.y * stated.of(name).scale for name, f in drives])
    drive_unit = source.find_unit(drives[0][0], "force", drives[0][1].of.numerator.unit or "g")
    return source.set_level(source.leave_flat(CampaignRun(label, None, drive_unit, x, control, channels)), label)
