"""``damping campaign``: a laboratory's files to modes, records, a study and its page (form ``campaign/1``)."""

import math
import os
from collections.abc import Collection, Sequence
from pathlib import Path

from damping.campaign import analyse
from damping.campaign.answer import Campaign, ModeAnswer
from damping.campaign.comparison import EarlierCampaign
from damping.campaign.runs import DesignLevel, read_corrections
from damping.campaign.values import At, Bounds, Response
from damping.errors import InputError, naming
from damping.extrapolation.cautions import find_refusal
from damping.formats.columns import open_table
from damping.formats.conversion import SCALINGS
from damping.formats.headers import find_abscissa_factor
from damping.formats.roles import find_roles
from damping.formats.series import Stated
from damping.records.mode import describe_mode_to_toml, quote_toml
from damping.records.record import record_to_csv
from damping.records.text import read_bytes
from damping.report.page import Footer, fill_text, render_page
from damping_pipelines.campaign_page import describe_frequency, describe_level, write_page
from damping_pipelines.forms import CampaignForm, IntervalForm, PeakForm, read_form
from damping_pipelines.manifest import digest_inputs, list_altered, publish, sole_writer, versions
from damping_pipelines.store import refuse_inputs, to_json
from damping_pipelines.terminal import (
    PlainTable,
    console,
    name_quantity,
    number,
    number_whole,
    parse_number,
    parse_pairs,
    report_findings,
)

PAGES = ("campaign.json", "report.html", "study.toml")  #: outputs of every campaign


def campaign(
    sources: Sequence[Path],
    out: Path,
    design: Sequence[str],
    modes: str | None,
    correct: Path | None,
    limit: Sequence[str],
    columns: Sequence[str],
    units: Sequence[str],
    previous: Path | None,
    seed: int,
    max_size: int,
    despite: Collection[str],
) -> None:
    """Analyse files and write ``campaign.json``, ``report.html``, ``study.toml`` and ``modes/`` below ``out``.

    InputError: bad usage, unreadable files, an edited file in the way, or a mode that the audit refuses.
    AnalysisError: no mode can be followed over the levels.
    """
    tables = [Path(word) for word in design if math.isnan(parse_number(word))]
    read = [*sources, *(path for path in (correct, previous) if path), *tables]
    refuse_inputs("--out", out, *read)
    named = [os.path.realpath(file) for file in sources]
    twice = next((file for place, file in enumerate(sources) if named[place] in named[:place]), None)
    if twice is not None:
        raise InputError("is given twice", file=twice, expected="each file once")
    corrections = read_corrections(correct) if correct else None
    levels = [_read_design(word) for word in design]
    wanted, limits = _frequencies(modes), _read_limits(limit)
    before = _read_earlier(previous) if previous else None
    facts = Stated(columns=parse_pairs("--column", columns), units=parse_pairs("--unit", units))
    with sole_writer(out, PAGES, read):
        _refuse_edited(out)
        answer = analyse(sources, levels, wanted, seed, max_size, corrections, limits, before, facts)
        for mode in answer.modes:
            report_findings(mode.record, mode.mode, despite)
        inputs = digest_inputs(read)
        title = f"Campaign: {', '.join(file.name for file in sources)}"
        written = _write_files(answer, title, seed, inputs)
        publish(out, written, seed=seed, versions=versions(), inputs=inputs)
    _show(answer, out)


def _refuse_edited(out: Path) -> None:
    """InputError, before any work, for a study, mode or record that was edited after an earlier run wrote it."""
    for name in sorted(list_altered(out)):
        if name.endswith((".toml", ".csv")) and os.path.lexists(out / name):
            message = "has been edited since an earlier run wrote it, and would be replaced"
            raise InputError(message, file=out / name, expected="another --out, or that file moved")


def _write_files(answer: Campaign, title: str, seed: int, inputs: dict[str, str]) -> dict[str, bytes]:
    """Contents of every file by its name in the folder."""
    asked = {mode.name: [quote_toml(text) for text in _name_forces(mode, answer)] for mode in answer.modes}
    settings = {"title": quote_toml(title), "seed": seed, "modes": answer.modes, "asked": asked}
    texts = {f"modes/{mode.name}/record.csv": record_to_csv(mode.record) for mode in answer.modes}
    texts |= {f"modes/{mode.name}/mode.toml": describe_mode_to_toml(mode.mode) for mode in answer.modes}
    texts["study.toml"] = fill_text(Path(__file__).with_name("campaign_study.txt"), settings)
    texts["campaign.json"] = to_json(answer.to_json())
    texts["report.html"] = render_page(title, write_page(answer), Footer(seed, versions(), inputs))
    return {name: text.encode() for name, text in texts.items()}


def _name_forces(mode: ModeAnswer, answer: Campaign) -> list[str]:
    """The requested levels behind the design forces of a mode; none if forces were requested."""
    levels = [f"{at.level:.4g} {answer.unit}".rstrip() for at in mode.places if not at.tested]
    return levels if answer.level_name != "force" and len(levels) == len(mode.design_forces) else []


def _read_design(word: str) -> DesignLevel:
    """A level, or the curve in a table with columns frequency (Hz) and level, whose header may state the unit.

    InputError for anything else.
    """
    level, path = parse_number(word), Path(word)
    if not math.isnan(level):
        return DesignLevel.flat(level)
    if not path.suffix:
        raise InputError(f"--design {word!r} is no level", expected="a number > 0, or a table of frequency and level")
    named = {"frequency": ("frequency", "freq", "f"), "level": ("level", "amplitude", "input")}
    with naming(path):
        table = open_table(read_bytes(path))
        places = find_roles(table.headers, {}, named, table.line).places
        missing = [name for name in named if name not in places]
        if missing:
            raise InputError(f"no column {missing[0]}", expected="columns frequency (Hz) and level")
        of_frequency, of_level = (table.headers[places[name]] for name in named)
        numbers, _ = table.read(places)
        hertz = find_abscissa_factor("frequency", of_frequency.unit)
        peak = SCALINGS[of_level.scaling or "peak"]
        return DesignLevel(hertz * numbers["frequency"], peak * numbers["level"], of_level.unit)


def _read_earlier(path: Path) -> EarlierCampaign:
    """The levels with known peaks of a form ``campaign/1``.

    InputError: another file, or a mode without a frequency or peaks.
    """
    expected = "campaign.json of a campaign"
    form = read_form(CampaignForm, read_bytes(path), path, expected)
    modes: dict[float, list[At]] = {}
    for mode in form.modes:
        if mode.frequency is None or not any(at.response for at in mode.at):
            raise InputError(f"{mode.name!r} has no frequency or no response", file=path, expected=expected)
        for at in mode.at:
            known = [(peak, band) for peak in at.response if (band := _find_band(peak))]
            peaks = tuple(Response(peak.sensor, peak.quantity, peak.unit, band) for peak, band in known)
            frequency = math.nan if at.frequency is None else at.frequency
            if peaks:
                place = At(at.level, bool(at.tested), frequency, _find_band(at.damping_ratio), peaks, (), at.input)
                modes.setdefault(mode.frequency, []).append(place)
    return EarlierCampaign(modes, form.level_unit)


def _find_band(of: IntervalForm | PeakForm | None) -> Bounds | None:
    """The band of a form; None unless it has a median and both ends."""
    if of is None or of.median is None or of.low is None or of.high is None:
        return None
    return Bounds(of.median, of.low, of.high)


def _read_limits(words: Sequence[str]) -> dict[str, float]:
    """SENSOR=VALUE words; names of sensors may contain ``=``. InputError for an invalid limit."""
    meaning = "SENSOR=VALUE, in the sensor's unit"
    texts = parse_pairs("--limit", words, meaning, last=True)
    limits = {name: parse_number(text) for name, text in texts.items()}
    wrong = next((name for name, limit in limits.items() if not 0.0 < limit < math.inf), None)
    if wrong is not None:
        raise InputError(f"--limit {wrong}={texts[wrong]} is no limit", expected=meaning)
    return limits


def _frequencies(text: str | None) -> list[float]:
    """F1,F2,… in Hz. InputError for invalid text."""
    if text is None:
        return []
    frequencies = sorted(map(parse_number, text.split(",")))
    if not all(0.0 < f < math.inf for f in frequencies) or len(set(frequencies)) < len(frequencies):
        raise InputError(f"--modes {text!r} is not understood", expected="different frequencies in Hz, F1,F2,...")
    return frequencies


def _show(answer: Campaign, out: Path) -> None:
    to = console()
    to.print("What was understood (--correct FILE.toml overrides it):")
    for what, text, _ in answer.summary.rows:
        to.print(f"  {what}: {text}")
    for note in answer.summary.notes:
        to.print(f"- {note}")
    level = name_quantity(answer.level_name, answer.unit)
    damping = PlainTable("damping of each mode", (level, "Hz", "damping %", "±", "low", "high"), ("mode",))
    peaks = PlainTable("peak of the sensor that moves most", (level, "peak", "low", "high"), ("mode", "sensor"))
    for mode in answer.modes:
        for at in mode.places:
            ratio = [number_whole(100.0 * part, 3, "#") for part in at.ratio] if at.ratio else ["-"] * 3
            largest = at.largest
            peak = [number_whole(part, 3, "#") for part in largest.band] if largest else ["-"] * 3
            sensor = f"{largest.sensor} ({largest.unit})" if largest else "-"
            error = number_whole(100.0 * at.ratio_error, 2) if at.ratio_error else "-"
            damping.add_row(mode.name, number(at.level), describe_frequency(at), ratio[0], error, *ratio[1:])
            peaks.add_row(mode.name, sensor, number(at.level), *peak)
    to.print(damping)
    if answer.is_driven:  # the level of a free decay is this peak
        to.print(peaks)
    to.print(
        "±: standard error. low to high: 90 % band, at a tested level measured on its own rows, at a design level "
        "predictive, averaged over laws by weight."
    )
    for mode in answer.modes:
        left_out = [f"{mode.name} without {name}: {why}" for name, why in mode.left_out.items()]
        placed = [(f"{mode.name} at {describe_level(at, answer.unit)}", at) for at in mode.places]
        notched = [where for where, at in placed if at.reached is not None]
        refused = [f"{where}: {why}" for where, at in placed if (why := find_refusal(at.cautions))]
        for line in (*left_out, *notched, *refused, *mode.notches):
            to.print(f"- {line}")
    for line in (*answer.changes, *answer.outcomes):
        to.print(f"- {line}")
    to.print(f"written to {out}")
