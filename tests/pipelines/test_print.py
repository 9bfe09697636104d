"""The answer of a study as a PDF of one page."""

import re
import shutil
from pathlib import Path

import pytest

from damping.errors import AnalysisError
from damping_pipelines import store

REPORT = Path(__file__).parents[2] / "results" / "saturn-v" / "report.html"


BROWSER = any(map(shutil.which, store.BROWSERS))


@pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine; .ci/run installs it")
def test_the_answer_is_one_page():
    printed = store.print_answer(REPORT.read_text())
    assert printed.startswith(b"%PDF")
    assert re.findall(rb"/Count (\d+)", printed) == [b"1"]


def test_without_a_browser_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr(store, "BROWSERS", ("no-such-browser",))
    with pytest.raises(AnalysisError, match=r"no-such-browser is installed; print report\.html from any browser"):
        store.print_answer("")


def test_a_browser_that_hangs_is_not_waited_for(monkeypatch, tmp_path):
    (tmp_path / "hangs").write_text("#!/bin/sh\nexec sleep 60\n")
    (tmp_path / "hangs").chmod(0o755)
    monkeypatch.setattr(store, "BROWSERS", (str(tmp_path / "hangs"),))
    monkeypatch.setattr(store, "LONGEST_PRINT", 0.1)
    with pytest.raises(AnalysisError, match=r"has not printed within 0\.1 s; print report\.html from any browser"):
        store.print_answer("")
