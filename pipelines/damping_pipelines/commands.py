"""Every command on files and folders, declared by its options, which ``--help`` explains.

The module that a command names does the work.
"""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from damping_pipelines.options import (
    DEFAULT_SEED,
    MAX_SIZE,
    MOST_PROCESSES,
    NONE,
    Despite,
    Folder,
    Folders,
    Jobs,
    Json,
    Level,
    MaxSize,
    Plot,
    RecordOut,
    Seed,
    delegate,
)


@delegate(".gap")
def gap(
    model: Annotated[Path, Argument(metavar="MODEL.toml|CASES_DIR", help="Simulation, or a folder of cases.")],
    records: Annotated[
        list[Path], Argument(metavar="[RECORD.csv]", help="Measured record; each --with adds its own.")
    ] = NONE,
    report: Annotated[Path | None, Option(metavar="FILE.html", help="Write the report page.")] = None,
    model_out: Annotated[Path | None, Option(metavar="FILE.toml", help="Write the corrected model.")] = None,
    json_out: Json = None,
    posterior: Annotated[bool | None, Option(help="Sample the leading explanation (default: for one record).")] = None,
    seed: Seed = DEFAULT_SEED,
    jobs: Annotated[int | None, Option(min=1, max=MOST_PROCESSES, help="Processes for a folder of cases.")] = None,
    states: Annotated[
        list[Path],
        Option("--with", metavar="MODEL.toml RECORD.csv", help="Another state of the structure; repeatable."),
    ] = NONE,
    simulator: Annotated[str | None, Option(metavar="MODULE:FUNCTION", help="Your own simulation.")] = None,
    plot: Plot = None,
    despite: Despite = NONE,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Diagnose the gap between a simulation and a test.

    docs/reference/effects.md explains every effect.
    """


@delegate(".campaign")
def campaign(
    sources: Annotated[list[Path], Argument(metavar="FILE...", help="UFF, HDF5, MAT, TDMS, XLSX or CSV.")],
    out: Folder,
    design: Annotated[
        list[str],
        Option(
            metavar="LEVEL|FILE.csv",
            help="Design level in the drive's unit, or table of frequency, level; repeatable. Default: twice the top.",
        ),
    ] = NONE,
    modes: Annotated[str | None, Option(metavar="F1,F2,...", help="Frequencies of modes, Hz; default: found.")] = None,
    correct: Annotated[
        Path | None, Option(metavar="FILE.toml", help="Corrects levels of runs, roles and units of channels.")
    ] = None,
    limit: Annotated[
        list[str], Option(metavar="SENSOR=VALUE", help="Limit of a sensor: gives the notch; repeatable.")
    ] = NONE,
    columns: Annotated[
        list[str],
        Option("--column", metavar="ROLE=NAME", help="Column of frequency, omega, sweep or force; repeatable."),
    ] = NONE,
    units: Annotated[
        list[str], Option("--unit", metavar="WHAT=UNIT", help="Unit of force (the drive) or response; repeatable.")
    ] = NONE,
    previous: Annotated[
        Path | None, Option(metavar="campaign.json", help="Earlier answer, to compare with these runs.")
    ] = None,
    seed: Seed = DEFAULT_SEED,
    despite: Despite = NONE,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Every mode and sensor of a campaign at the design level. Reads a laboratory's files as they are.

    Tables against frequency have the drive, and each sensor with its phase (tip [mm], tip phase [deg]), its parts (tip
    re, tip im) or complex values; a file, sheet, group or sweep for each level. Tables against time have motions.
    """


@delegate(".import_")
def import_(
    file: Annotated[Path, Argument(metavar="FILE", help="UFF/UNV, MAT, HDF5, TDMS, LVM, WAV, netCDF, XLSX or CSV.")],
    out: RecordOut,
    format: Annotated[
        str, Option("--format", help="auto, uff, mat, hdf5, tdms, lvm, wav, xlsx, csv or lock-in; auto looks inside.")
    ] = "auto",
    columns: Annotated[
        list[str], Option("--column", metavar="ROLE=NAME", help="Column or array of a role; repeatable.")
    ] = NONE,
    response: Annotated[
        str | None, Option(help="receptance, mobility, accelerance, displacement, velocity or acceleration.")
    ] = None,
    scaling: Annotated[
        list[str], Option(metavar="[force=]X", help="Amplitudes (force=: of the force): peak, rms or peak-to-peak.")
    ] = NONE,
    units: Annotated[
        list[str], Option("--unit", metavar="WHAT=UNIT", help="Unit of force, response or another (above); repeatable.")
    ] = NONE,
    consistent: Annotated[
        bool, Option("--consistent", help="All values are in one consistent system of units.")
    ] = False,
    scale: Annotated[list[str], Option(metavar="WHAT=X", help="Factor of force or response; repeatable.")] = NONE,
    system: Annotated[str, Option("--to", metavar="si|us", help="Units of the record: N and m, or lbf and in.")] = "si",
    forces: Annotated[
        list[float], Option("--force", metavar="F", help="Force amplitude: one, or one per sweep.")
    ] = NONE,
    labels: Annotated[list[str], Option("--label", metavar="L", help="Label of each sweep.")] = NONE,
    datasets: Annotated[
        list[int], Option("--dataset", metavar="N", help="Data set 58 (repeatable) or sheet to read, from 1.")
    ] = NONE,
    band: Annotated[str | None, Option(metavar="LO:HI", help="Frequencies to read, Hz.")] = None,
    reverse: Annotated[bool, Option("--reverse", help="The sensor is mounted against the force.")] = False,
    delimiter: Annotated[str, Option(help="comma, semicolon, tab, space or auto.")] = "auto",
    decimal: Annotated[str, Option(help="Decimal mark: point, comma or auto.")] = "auto",
    skip: Annotated[int, Option(min=0, help="Lines before the header of a CSV file.")] = 0,
    rate: Annotated[float | None, Option(metavar="HZ", help="Sampling rate of a signal without times.")] = None,
    ring_down: Annotated[bool, Option("--ring-down", help="Time histories are free decays of --mode.")] = False,
    mode: Annotated[Path | None, Option(metavar="MODE.toml", help="Mode of the free decays: frequency, mass.")] = None,
    periods: Annotated[float | None, Option(help="Window of a decay, periods.")] = None,
    levels: Annotated[int | None, Option(help="Maximum number of levels of a decay.")] = None,
    start: Annotated[list[float], Option(help="Start of the decay, s; repeatable, with --end, for several.")] = NONE,
    end: Annotated[list[float], Option(help="End of the decay, s; else the next --start.")] = NONE,
    despite: Despite = NONE,
    json_out: Json = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Convert a laboratory's file to a record.

    Shows what was understood and asks for what is missing.

    Roles of --column: sweep, frequency (Hz), omega (rad/s), time (s); response (complex, or a signal against time), x
    and y (its parts), amplitude; phase (lag, rad), lag_deg, lead (rad), lead_deg, angle (lead or lag by its direction);
    force, force_x and force_y, force_lead_deg, force_angle; energy, mass, amplitude_sd, phase_sd, force_sd; sweep_rate
    (Hz/s).

    Units of --unit: force, response, energy, mass, such as N, lbf, m, mm, um, in, m/s, g, m/s^2, m/s^2/N, rad, kg;
    frequency Hz, kHz, rpm, rad/s; time s, ms, us, min; sweep_rate Hz/s, oct/min, dec/min. A header such as
    Accel [g rms] states its own.
    """


@delegate(".export")
def export(
    source: Annotated[
        Path,
        Argument(
            metavar="SOURCE", help="Record, or JSON of rank, extrapolate, curve; with --to campaign, study DIR too."
        ),
    ],
    out: Annotated[Path, Option(metavar="FILE", help="Output; format by its ending: .uff, .unv, .csv or .parquet.")],
    units: Annotated[str | None, Option(metavar="si|us", help="Convert to N and m, or lbf and in.")] = None,
    given: Annotated[
        str | None, Option("--from", metavar="si|us", help="Units of the record, if no mode names them.")
    ] = None,
    mode: Annotated[Path | None, Option(metavar="MODE.toml", help="Mode with the units of the record.")] = None,
    mode_out: Annotated[Path | None, Option(metavar="FILE.toml", help="Write the converted mode.")] = None,
    text: Annotated[bool, Option("--text", help="Write universal-file values as text, not binary.")] = False,
    to: Annotated[str | None, Option(metavar="CODE", help="Deck: nastran, abaqus, ansys, opensees, openfast.")] = None,
    of_record: Annotated[
        str | None, Option("--record", metavar="NAME", help="Record of a study with several, for --to.")
    ] = None,
    despite: Despite = NONE,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Write a deck for a structural code, or convert files. Records and results to other formats and units."""


@delegate(".compare")
def compare(folders: Folders, out: Annotated[Path, Option(metavar="FILE.html", help="Page to write.")]) -> None:
    """Compare studies: rankings, predictions, posteriors."""


@delegate(".compare", "check")
def verify(folders: Folders) -> None:
    """Check that all files of a folder are of one run."""


@delegate(".tables")
def regress(
    data: Annotated[list[Path], Argument(metavar="DATA.csv", help="Any table; of several, each gets the same curve.")],
    response: Annotated[str, Option(metavar="COL", help="The dependent column.")],
    terms: Annotated[list[str], Option(metavar='"T1, T2"', help="Terms; repeatable, one per curve.")],
    select: Annotated[str, Option(help="How terms are dropped: none, backward, forward, stepwise or best.")] = "none",
    criterion: Annotated[str, Option(help="Decides what --select keeps: bic, aic, aicc, adjusted-r2 or loo.")] = "bic",
    nonnegative: Annotated[bool, Option("--nonnegative", help="Keep every coefficient >= 0.")] = False,
    t_stop: Annotated[
        float | None, Option(metavar="T", help="Steps stop at this |T|, not by --criterion; forward drops none.")
    ] = None,
    plots: Annotated[Path | None, Option(metavar="DIR", help="Folder for plots of the deviations.")] = None,
    json_out: Json = None,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Regression of any table: the SHARE program of 1970. With selection of terms; section 5.2 of the report."""


@delegate(".tables")
def sweep(
    model: Annotated[Path, Argument(metavar="MODEL.toml", help="Mode file with a damping force.")],
    force: Annotated[list[float], Option(metavar="F", help="Force level; repeatable.")],
    frequency: Annotated[str, Option(metavar="LO:HI:N", help="Frequencies, Hz.")],
    out: RecordOut,
    direction: Annotated[str, Option(help="up or down.")] = "up",
    method: Annotated[str, Option(help="ritz (averaged) or time (integrated).")] = "ritz",
    structure: Annotated[
        bool, Option("--structure", help="Motion of the structure, for loads: without gain or lag of the rig.")
    ] = False,
) -> None:
    """Steady-state sweeps of a model, as a record."""


@delegate(".tables")
def condition(
    raw: Annotated[Path, Argument(metavar="RAW.csv", help="Accelerometer table.")],
    config: Annotated[Path, Option(metavar="CONDITION.toml", help="Nodes, modes, corrections, angle.")],
    out: RecordOut,
    steps: Annotated[Path | None, Option(metavar="DIR", help="Write a table per step, with its inputs.")] = None,
    despite: Despite = NONE,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Convert an accelerometer table to a modal record. As chapter III of the report of 1970 does."""


@delegate(".fleet")
def fleet(
    records: Annotated[
        Path,
        Argument(
            metavar="RECORDS_DIR",
            help="NAME.csv with NAME.toml or mode.toml, NAME/record.csv with mode.toml, NAME/data.csv with model.toml.",
        ),
    ],
    out: Annotated[Path, Option(metavar="DIR", help="Folder for the results; existing ones are kept.")],
    scheduler: Annotated[
        str | None, Option(metavar="ADDRESS", help="A running Dask scheduler; default: local.")
    ] = None,
    fast: Annotated[bool, Option("--fast", help="Use fewer importance draws.")] = False,
    workers: Annotated[
        int | None, Option(min=0, max=MOST_PROCESSES, help="Processes of the local cluster; 0: this process.")
    ] = None,
    force: Annotated[
        list[float], Option(metavar="F", help="Design force; default: 1.5 and 2 times the largest tested.")
    ] = NONE,
    level: Level = 0.9,
    seed: Seed = DEFAULT_SEED,
    dashboard: Annotated[str, Option(metavar="HOST:PORT", help="Dask's dashboard, or off.")] = "127.0.0.1:8787",
    replace: Annotated[bool, Option("--replace", help="Drop results of other records or versions in DIR.")] = False,
    time_limit: Annotated[float, Option(metavar="SECONDS", help="Longest time for a record.")] = 3600.0,
    despite: Despite = NONE,
    max_size: MaxSize = MAX_SIZE,
) -> None:
    """Rank, extrapolate and diagnose many records on Dask."""


@delegate("damping_validation.blind")
def blind(
    out: Folder = Path("results/blind"),
    cases: Annotated[int, Option(max=100_000, help="Number of cases.")] = 2000,
    seed: Annotated[int | None, Option(min=0, help="Seed; default: the one reserved for blind cases.")] = None,
    jobs: Jobs = None,
    follow: Annotated[bool, Option("--next", help="Run every proposed test and diagnose again.")] = False,
) -> None:
    """Check the diagnosis on cases whose effect is withheld."""


@delegate("damping_validation.bands", "bands_page")
def bands(
    records: Annotated[Path, Argument(metavar="FOLDER", help="NAME/record.csv with NAME/mode.toml.")],
    out: Folder,
    seed: Seed = DEFAULT_SEED,
    despite: Despite = NONE,
) -> None:
    """Report design-load bands on a folder of records. Higher levels are held out as a check."""


@delegate("damping_validation.calibrate")
def calibrate(
    out: Folder,
    quick: Annotated[bool, Option("--quick", help="Run a tenth of the trials.")] = False,
    seed: Seed = DEFAULT_SEED,
    jobs: Jobs = None,
) -> None:
    """Check the coverage of bands on known structures. Of posteriors too."""
