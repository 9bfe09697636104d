"""A folder of results is of one run or says that it is not: killed, full, read-only, tampered with."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks import kills
from damping.errors import InputError
from damping_pipelines.manifest import MANIFEST, digest, open_folder, publish, sole_writer, verify

OLD = {"a.csv": b"old a", "figures/b.svg": b"old b", "only-old.csv": b"x"}
#: Studies killed.
KILLS = 4
NEW = {"a.csv": b"new a", "figures/b.svg": b"new b", "figures/only-new.svg": b"y"}


SHIPPED = sorted(path.parent for path in (Path(__file__).parents[2] / "results").glob("*/manifest.json"))


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda folder: folder.name)
def test_shipped_results_are_of_one_run(folder):
    assert verify(folder).manifest.outputs


def put(folder: Path, files: dict[str, bytes], seed: int = 1) -> None:
    publish(folder, files, seed=seed, versions={"numpy": "2"}, inputs={"r.csv": "0" * 64})


def contents(folder: Path) -> dict[str, bytes]:
    found = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return {name: content for name, content in found.items() if name != MANIFEST}


@pytest.mark.sampling
@pytest.mark.slow
def test_studies_are_killed(tmp_path, forking, monkeypatch):
    """At any moment and while it writes; the assertions are those of the benchmark, which kills fifty."""

    class Forked(kills.Studies):
        """Their server is one of the processes that need not import everything again."""

        def __enter__(self):
            code = "from benchmarks._short_study import serve; serve()"
            fork, asked, answered = forking.talk(code, paths=[Path(kills.__file__).parents[1]])
            self.server = SimpleNamespace(stdin=asked, stdout=answered, wait=fork.wait)
            return self

    monkeypatch.setattr(kills, "Studies", Forked)
    tally = kills.run(tmp_path, KILLS, seed=3)
    assert tally.kills == KILLS
    assert tally.fitting + tally.refused == KILLS


def test_a_run_replaces_another_whole(tmp_path):
    put(tmp_path, OLD)
    put(tmp_path, NEW, seed=2)
    assert contents(tmp_path) == NEW
    found = verify(tmp_path)
    assert found.manifest.seed == 2
    assert found.read("a.csv") == b"new a"
    assert not (tmp_path / ".staged").exists()


class StoppedError(BaseException):
    """The process ends here."""


@pytest.mark.parametrize("moment", range(8))
def test_stopped_at_every_move(tmp_path, monkeypatch, moment):
    """Each renaming and removal of a second run as its last act: a reader gets one run or is told, never two."""
    put(tmp_path, OLD)
    left = moment

    def until(real):
        def act(*words, **options):
            nonlocal left
            if ".staged" in str(words[-1]):  # staging changes no result
                return real(*words, **options)
            if left == 0:
                raise StoppedError
            left -= 1
            return real(*words, **options)

        return act

    monkeypatch.setattr(os, "replace", until(os.replace))
    monkeypatch.setattr(Path, "unlink", until(Path.unlink))
    try:
        put(tmp_path, NEW, seed=2)
    except StoppedError:
        monkeypatch.undo()
        now = {name: content for name, content in contents(tmp_path).items() if not name.startswith(".staged")}
        assert all(content in (OLD.get(name), NEW.get(name)) for name, content in now.items())
        if moment == 0:
            assert verify(tmp_path).manifest.seed == 1
            assert now == OLD
        else:
            with pytest.raises(InputError, match=r"is not from the run of the manifest|no such file"):
                verify(tmp_path)
        with sole_writer(tmp_path):
            put(tmp_path, NEW, seed=2)
    assert contents(tmp_path) == NEW
    assert verify(tmp_path).manifest.seed == 2


def test_what_is_no_folder_of_results(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        open_folder(tmp_path / "missing")
    with pytest.raises(InputError, match=r"no manifest\.json; expected the folder of a run that was finished"):
        open_folder(tmp_path)
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="is no folder"):
        open_folder(tmp_path / "file")
    for text in ("", "x", "[]", '{"format": "manifest/9"}', '{"format": "manifest/1", "seed": 1}', "{" * 9000):
        (tmp_path / MANIFEST).write_text(text)
        with pytest.raises(InputError):
            open_folder(tmp_path)


@pytest.mark.parametrize("name", ["../secret", "/etc/passwd", "a/../../secret", "..", "", "a\\..\\b", "a\0b"])
def test_names_outside_the_folder(tmp_path, name):
    folder = tmp_path / "results"
    put(folder, OLD)
    (tmp_path / "secret").write_bytes(b"secret")
    form = json.loads((folder / MANIFEST).read_text())
    form["outputs"][name] = digest(b"secret")
    (folder / MANIFEST).write_text(json.dumps(form))
    with pytest.raises(InputError, match="outside the folder"):
        open_folder(folder)


def test_links_are_not_followed(tmp_path):
    folder, secret = tmp_path / "results", tmp_path / "secret"
    put(folder, OLD)
    secret.write_bytes(OLD["a.csv"])  # even one with the right contents
    (folder / "a.csv").unlink()
    (folder / "a.csv").symlink_to(secret)
    with pytest.raises(InputError, match="is a link"):
        verify(folder)
    put(folder, NEW)
    assert secret.read_bytes() == OLD["a.csv"]
    assert not (folder / "a.csv").is_symlink()
    (folder / "figures").rename(tmp_path / "elsewhere")
    (folder / "figures").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="behind a link"):
        verify(folder)


def test_the_folder_itself_may_be_a_link(tmp_path):
    """As to a scratch disk: a run writes there, and what it wrote can be read."""
    (tmp_path / "scratch").mkdir()
    (tmp_path / "results").symlink_to(tmp_path / "scratch")
    put(tmp_path / "results", OLD)
    assert sorted(verify(tmp_path / "results").manifest.outputs) == sorted(OLD)


def test_one_run_at_a_time(tmp_path):
    with sole_writer(tmp_path), pytest.raises(InputError, match="another run is writing here"):  # noqa: SIM117 - held by the first
        with sole_writer(tmp_path):
            raise AssertionError
    with sole_writer(tmp_path):
        pass


def test_two_campaigns_into_one_folder(tmp_path, damping, monkeypatch):
    """The second is refused before it analyses anything, and removes nothing that the first has staged."""
    source, staged = tmp_path / "a.csv", tmp_path / "out" / ".staged" / "campaign.json"
    source.write_text("not read\n")
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: pytest.fail("it is told after the work"))
    with sole_writer(tmp_path / "out"):
        staged.parent.mkdir()
        staged.write_text("of the first")
        run = damping("campaign", source, "--out", tmp_path / "out")
        assert (run.code, "another run is writing here" in run.err) == (2, True)
        assert staged.read_text() == "of the first"


def test_a_folder_left_empty_goes_again(tmp_path):
    for ours, there in ((tmp_path / "new", False), (tmp_path, True)):
        with pytest.raises(KeyboardInterrupt), sole_writer(ours):
            raise KeyboardInterrupt
        assert ours.exists() is there


#: What runs with files limited to a number of bytes, as on a full disk; what it says has room until it ends.
LIMITED = """import atexit, io, resource, sys
from pathlib import Path
out, size, limits = Path(sys.argv[1]), int(sys.argv[2]), resource.getrlimit(resource.RLIMIT_FSIZE)
def say():
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    sys.__stderr__.write(sys.stderr.getvalue())
atexit.register(say)
sys.stderr = io.StringIO()
resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
"""


def test_a_full_disk_leaves_the_earlier_results(tmp_path, forking):
    put(tmp_path, OLD)
    body = (
        "from damping_pipelines.manifest import publish\n"
        "from damping.errors import InputError\n"
        "files = {'a.csv': b'new a', 'report.html': b'x' * 9000}\n"
        "try: publish(out, files, seed=2, versions={}, inputs={})\n"
        "except InputError as error: print(error)\n"
    )
    done = forking.run(LIMITED + body, tmp_path, 5000)
    assert done.stdout.count("\n") == 1
    assert "cannot be written (File too large); expected a writable place with free space" in done.stdout
    assert contents(tmp_path) == OLD
    assert verify(tmp_path).manifest.seed == 1


def test_a_study_on_a_full_disk(tmp_path, forking):
    """It ends with one line before it has computed anything."""
    settings = kills.Studies(tmp_path).settings
    out = tmp_path / "out"
    put(out, OLD)
    body = f"from damping_pipelines.cli import main\nmain(['study', {str(settings)!r}, '--out', str(out)])"
    done = forking.run(LIMITED + body, out, 5)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "cannot be written (File too large)" in done.stderr
    assert contents(out) == OLD
    assert verify(out).manifest.seed == 1


@pytest.mark.parametrize("command", ["study", "campaign"])
def test_a_read_only_folder(tmp_path, damping, monkeypatch, command):
    """Told at once, not after the computation. The superuser may write anywhere, so the system's answer is played."""
    settings, out = kills.Studies(tmp_path).settings, tmp_path / "out"
    out.mkdir()
    refuse = PermissionError(13, "Permission denied")
    monkeypatch.setattr("tempfile.mkstemp", lambda **_: (_ for _ in ()).throw(refuse))
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: pytest.fail("it is told after the work"))
    run = damping(command, settings, "--out", out)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert "cannot be written (Permission denied); expected a writable place with free space" in run.err
    assert list(out.iterdir()) == []
