#!/usr/bin/env bash
# The lowest versions that pyproject.toml states, in an environment of their own: what stands on them most is tested.
set -euo pipefail
clone="$(cd "$(dirname "$0")/../.." && pwd)"
python="${1:-python3.11}" # the oldest Python that is supported: the lowest versions have no wheels for newer ones
work="$(mktemp --directory)"
trap 'rm -rf "$work"' EXIT

"$python" -m venv "$work/env"
bin="$work/env/bin"
"$bin/python" -m pip install --quiet --disable-pip-version-check --prefer-binary \
	--constraint "$clone/constraints-lowest.txt" --editable "$clone[fleet,formats]" pytest pytest-xdist hypothesis pyuff
cd "$clone"
# new pyparsing warns of what the lowest matplotlib calls: none of ours. Types are those of the newest versions, and so is
# what SciPy loads. The lowest netCDF4 is built with a later NumPy, whose arrays are larger: harmless, and ignored by NumPy
"$bin/python" -m pytest -p no:cacheprovider --disable-warnings --ignore tests/api/test_typing.py \
	-W "ignore:numpy.ndarray size changed:RuntimeWarning" \
	--deselect tests/pipelines/test_cli.py::test_commands_on_peaks_load_what_they_use \
	tests/api tests/forces tests/contract tests/records tests/regression tests/predict tests/signals tests/formats \
	tests/infer tests/ranking tests/extrapolation/test_near.py tests/gap/test_command.py tests/gap/test_size.py \
	tests/plots/test_figures.py tests/report/test_page.py tests/report/test_tables.py tests/reed1970/test_report_tables.py \
	tests/pipelines/test_{cli,store,manifest,fleet,condition,files_commands}.py
