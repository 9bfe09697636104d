"""Commands on files that people bring and take away and on folders of results; options that commands share.

``damping import`` and ``damping export``: options to stages. What each option means is said by ``--help``.

``damping compare`` and ``damping verify``: folders that studies wrote.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from damping.errors import InputError

MAX_SIZE = 200_000_000
DEFAULT_SEED = 1970
#: Processes of one machine.
MOST_PROCESSES = 1024

Json = Annotated[str | None, typer.Option("--json", metavar="FILE", help="Write the JSON form; - is stdout.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of everything that is sampled.")]
MaxSize = Annotated[int, typer.Option("--max-size", min=1, help="Largest input file accepted, bytes.")]
Despite = Annotated[
    list[str] | None,
    typer.Option("--despite", metavar="CHECK", help="Go on although this check of the audit refuses; repeat."),
]
RecordArgument = Annotated[Path, typer.Argument(metavar="RECORD.csv", help="Record: one row a measured steady state.")]
ModeOption = Annotated[Path, typer.Option("--mode", metavar="MODE.toml", help="Mode: frequency, mass, units.")]
Plot = Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it: a name in .svg or .png.")]
Forces = Annotated[list[float] | None, typer.Option("--force", metavar="F", help="Force at resonance; repeat.")]
Amplitudes = Annotated[
    list[float] | None, typer.Option("--amplitude", metavar="A", help="Amplitude at resonance; repeat.")
]
Level = Annotated[float, typer.Option("--level", help="Probability content of the bands.")]

_File = Annotated[
    Path, typer.Argument(metavar="FILE", help="UFF/UNV, MAT, HDF5, TDMS, LVM, netCDF, CSV or lock-in readings.")
]
_Units = typer.Option("--units", metavar="si|us", help="Convert to N and m, or lbf and in.")


def import_(
    file: _File,
    out: Annotated[Path, typer.Option("--out", metavar="RECORD.csv", help="The record written.")],
    file_format: Annotated[
        str, typer.Option("--format", help="auto, uff, mat, hdf5, tdms, lvm, csv or lock-in; auto looks inside.")
    ] = "auto",
    column: Annotated[
        list[str] | None, typer.Option("--column", metavar="ROLE=NAME", help="Column or array of a role; repeat.")
    ] = None,
    response: Annotated[
        str | None,
        typer.Option("--response", help="receptance, mobility, accelerance, displacement, velocity or acceleration."),
    ] = None,
    scaling: Annotated[
        list[str] | None,
        typer.Option(
            "--scaling",
            metavar="[force=]X",
            help="Amplitudes are peak, rms or peak-to-peak; force=X those of the force.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            "--unit", metavar="WHAT=UNIT", help="Unit of force, response, energy, mass, frequency or time; repeat."
        ),
    ] = None,
    consistent: Annotated[
        bool, typer.Option("--consistent", help="All values are of one system of units: take them as they are.")
    ] = False,
    scale: Annotated[
        list[str] | None,
        typer.Option("--scale", metavar="WHAT=X", help="Factor (sensitivity) of force or response; repeat."),
    ] = None,
    to: Annotated[
        str, typer.Option("--to", metavar="si|us", help="Units of the record: N and m, or lbf and in.")
    ] = "si",
    force: Annotated[
        list[float] | None, typer.Option("--force", metavar="F", help="Force amplitude: one, or one for each sweep.")
    ] = None,
    label: Annotated[list[str] | None, typer.Option("--label", metavar="L", help="Label of each sweep.")] = None,
    dataset: Annotated[
        list[int] | None, typer.Option("--dataset", metavar="N", help="Data set 58 to take, from 1; repeat.")
    ] = None,
    band: Annotated[str | None, typer.Option("--band", metavar="LO:HI", help="Frequencies to take, Hz.")] = None,
    reverse: Annotated[bool, typer.Option("--reverse", help="The sensor is mounted against the force.")] = False,
    delimiter: Annotated[str, typer.Option("--delimiter", help="comma, semicolon, tab, space or auto.")] = "auto",
    decimal: Annotated[str, typer.Option("--decimal", help="Mark in numbers: point, comma or auto.")] = "auto",
    skip: Annotated[int, typer.Option("--skip", min=0, help="Lines before the header of a CSV file.")] = 0,
    ring_down: Annotated[
        bool, typer.Option("--ring-down", help="Time histories are free decays of the mode of --mode.")
    ] = False,
    mode: Annotated[
        Path | None, typer.Option("--mode", metavar="MODE.toml", help="Mode of the free decays: frequency, mass.")
    ] = None,
    periods: Annotated[float | None, typer.Option("--periods", help="Window of a decay, periods.")] = None,
    levels: Annotated[int | None, typer.Option("--levels", help="Most levels taken of a decay.")] = None,
    start: Annotated[float | None, typer.Option("--start", help="Where the decay starts, s.")] = None,
    end: Annotated[float | None, typer.Option("--end", help="Where it ends, s.")] = None,
    despite: Despite = None,
    json_out: Json = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """A laboratory's file to a record; shows what was understood, asks for what neither file nor option says.

    Roles of --column: sweep, frequency (Hz), omega (rad/s), time (s); response (complex, or a signal against time), x
    and y (its parts), amplitude; phase (lag, rad), lag_deg, lead (rad), lead_deg, angle (lead or lag by its turn);
    force, force_x and force_y, force_lead_deg; energy, mass, amplitude_sd, phase_sd, force_sd.

    Units of --unit: force, response, energy, mass, such as N, lbf, m, mm, um, in, m/s, g, m/s^2, m/s^2/N, rad, kg;
    frequency Hz, kHz, rpm, rad/s; time s, ms, us, min. A header such as Accel [g rms] says its own.
    """
    from damping.formats.series import Stated
    from damping_pipelines.import_ import RingDown, import_file, pairs, scales, scalings
    from damping_pipelines.import_ import band as of_band

    of_response, of_force = scalings(scaling or ())
    stated = Stated(
        format=file_format,
        columns=pairs("--column", column or ()),
        response=response,
        scaling=of_response,
        force_scaling=of_force,
        units=pairs("--unit", unit or ()),
        consistent=consistent,
        scale=scales(scale or ()),
        system=to,
        forces=tuple(force or ()),
        labels=tuple(label or ()),
        datasets=tuple(dataset or ()),
        band=of_band(band),
        reverse=reverse,
        delimiter=delimiter,
        skip=skip,
        decimal=decimal,
    )
    options = {"periods": periods, "levels": levels, "start": start, "end": end}
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    if not ring_down and (mode is not None or given):
        name = "mode" if mode is not None else next(iter(given))
        raise InputError(f"--{name} without --ring-down", expected="both, where the file holds free decays")
    if ring_down and mode is None:
        raise InputError("--ring-down without --mode", expected="--mode MODE.toml with the frequency and mass")
    decay = RingDown(mode, **given) if mode is not None else None
    import_file(file, out, stated, decay, json_out, max_size, tuple(despite or ()))


def export(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="Record (CSV), or a ranking or loads form (JSON).")],
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="Its ending says the format: .uff, .unv, .csv or .parquet.")
    ],
    units: Annotated[str | None, _Units] = None,
    given: Annotated[
        str | None, typer.Option("--from", metavar="si|us", help="Units the record is in, where no mode names them.")
    ] = None,
    mode: Annotated[
        Path | None, typer.Option("--mode", metavar="MODE.toml", help="Mode that names the units of the record.")
    ] = None,
    mode_out: Annotated[
        Path | None, typer.Option("--mode-out", metavar="FILE.toml", help="Write the converted mode here.")
    ] = None,
    text: Annotated[bool, typer.Option("--text", help="Values of a universal file as text, not bytes.")] = False,
    to: Annotated[
        str | None,
        typer.Option("--to", metavar="CODE", help="Damping for nastran, abaqus, ansys, opensees or openfast."),
    ] = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Records, rankings and loads to other formats and units; damping to a structural code."""
    from damping_pipelines.export import export as run
    from damping_pipelines.export import export_deck

    if to is not None:
        if units or given or mode or mode_out or text:
            raise InputError("--to beside an option of records", expected="--to CODE --out FILE alone")
        export_deck(source, out, to)
        return
    run(source, out, units=units, given=given, mode=mode, mode_out=mode_out, text=text, max_size=max_size)


_Folders = Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders that damping study wrote.")]


def compare(
    folders: _Folders,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.html", help="The page written.")],
) -> None:
    """Set studies side by side: rankings, predictions, posteriors."""
    from damping_pipelines.compare import compare as run

    run(folders, out)


def verify(folders: _Folders) -> None:
    """Check that every file of a folder is of one finished run."""
    from damping_pipelines.compare import check

    check(folders)


def regress(
    data: Annotated[list[Path], typer.Argument(metavar="DATA.csv", help="Any table; several: the same curve to each.")],
    response: Annotated[str, typer.Option("--response", metavar="COL", help="The dependent column.")],
    terms: Annotated[list[str], typer.Option("--terms", metavar='"T1, T2"', help="Terms; repeat for several curves.")],
    select: Annotated[str, typer.Option("--select", help="none, backward, forward, stepwise or best.")] = "none",
    criterion: Annotated[str, typer.Option("--criterion", help="bic, aic, aicc, adjusted-r2 or loo.")] = "bic",
    nonnegative: Annotated[bool, typer.Option("--nonnegative", help="Keep every coefficient >= 0.")] = False,
    t_stop: Annotated[float | None, typer.Option("--t-stop", help="Drop while the least |T| is below.")] = None,
    plots: Annotated[Path | None, typer.Option("--plots", metavar="DIR", help="Draw the deviations here.")] = None,
    json_out: Json = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """The SHARE multivariate regression program on any table (report, section 5.2)."""
    from damping_pipelines.regress import regress as run

    run(data, response, terms, select, criterion, nonnegative, t_stop, json_out, plots, max_size)


def sweep(
    model: Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Mode with its damping force.")],
    force: Annotated[list[float], typer.Option("--force", metavar="F", help="Force level; repeat for several.")],
    frequency: Annotated[str, typer.Option("--frequency", metavar="LO:HI:N", help="Frequencies, Hz.")],
    out: Annotated[Path, typer.Option("--out", metavar="RECORD.csv", help="The record written.")],
    direction: Annotated[str, typer.Option("--direction", help="up or down.")] = "up",
    method: Annotated[str, typer.Option("--method", help="ritz (averaged) or time (integrated).")] = "ritz",
) -> None:
    """Steady-state sweeps of a model, as a record."""
    from damping_pipelines.sweep import sweep as run

    run(model, force, frequency, out, direction, method)


def condition(
    raw: Annotated[Path, typer.Argument(metavar="RAW.csv", help="Accelerometer table.")],
    config: Annotated[
        Path, typer.Option("--config", metavar="CONDITION.toml", help="Nodes, modes, corrections, angle.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="RECORD.csv", help="The record written.")],
    steps: Annotated[
        Path | None, typer.Option("--steps", metavar="DIR", help="One table a step, with what it took.")
    ] = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Accelerometer table to modal record (report, chapter III)."""
    from damping_pipelines.condition import condition as run

    run(raw, config, out, steps, max_size)


def fleet(
    records: Annotated[
        Path, typer.Argument(metavar="RECORDS_DIR", help="NAME.csv with NAME.toml, or NAME/data.csv with model.toml.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where results go; what is there is not redone.")],
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A running Dask scheduler; else a local one.")
    ] = None,
    fast: Annotated[bool, typer.Option("--fast", help="few importance draws.")] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=0, max=MOST_PROCESSES, help="Processes of the local cluster; 0: none, one by one."
        ),
    ] = None,
    force: Annotated[
        list[float] | None,
        typer.Option("--force", metavar="F", help="Design force; without it 1.5 and 2 times the largest tested."),
    ] = None,
    level: Annotated[float, typer.Option("--level", help="Probability content of the bands.")] = 0.9,
    seed: Seed = DEFAULT_SEED,
    dashboard: Annotated[
        str, typer.Option("--dashboard", metavar="HOST:PORT", help="Dashboard of the local cluster; or: off.")
    ] = "127.0.0.1:8787",
    replace: Annotated[
        bool, typer.Option("--replace", help="Drop what DIR holds of other records, settings or versions.")
    ] = False,
    time_limit: Annotated[
        float, typer.Option("--time-limit", metavar="SECONDS", help="Give a record up that takes longer.")
    ] = 3600.0,
    despite: Despite = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Rank, extrapolate and diagnose many records on Dask."""
    from damping_pipelines.fleet.command import fleet as run

    run(
        records,
        out,
        scheduler=scheduler,
        fast=fast,
        workers=workers,
        forces=tuple(force or ()),
        level=level,
        seed=seed,
        dashboard=None if dashboard == "off" else dashboard,
        replace=replace,
        max_size=max_size,
        despite=tuple(despite or ()),
        time_limit=time_limit,
    )
